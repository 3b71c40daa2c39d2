// glTF metallic-roughness BRDF: Lambert under a GGX coat, conserving energy, and its sampling.
//
//   f = F D V + F_ms M(w_i) M(w_o) / (pi <M>) + (1 - m) c T(w_i) T(w_o) / (pi <T>),  F = F0 + (1 - F0)(1 - v.h)^5
// F D V is glTF's specular term (appendix B.3): GGX, height-correlated Smith (Heitz 2014, eq. 99), F0 = mix(0.04, c, m).
// It scatters once. What a metal's microfacets scatter again, M, adds the second term (Kulla and Conty 2017,
// "Revisiting Physically Based Shading at Imageworks"), F_ms = m <F>^2 (1 - <M>) / (1 - <F> <M>), <F> = (20 c + 1) / 21.
// The base gets what a dielectric's coat transmits, T, on the way in and out (Kelemen and Szirmay-Kalos 2001), as
// appendix B.2 mixes dielectric and metal; the approximation in B.3.5 takes 1 - F of the mixture instead. M and T:
// `common/coat_albedo.wgsl`; <> are their means. Reciprocal; a white surface reflects 1 at every roughness and
// metalness, other ones less; errs by the fits, at most 0.25 %. All directions are in the local frame, normal +Z.
#import "common/math.wgsl"
#import "common/sampling.wgsl"
#import "common/coat_albedo.wgsl"

// Below this GGX alpha the lobe is narrower than float32 half vectors resolve (roughness 0.032).
const MIN_ALPHA: f32 = 0.001;

struct Brdf {
    diffuse: vec3f,   // albedo of the Lambert part, (1 - metallic) base_color
    alpha: f32,       // GGX width, roughness squared
    f0: vec3f,        // reflectance at normal incidence
    glossy: bool,     // false: pure Lambert, no coat
    multiple: vec3f,  // F_ms, of light that the coat scatters more than once
    fit: CoatFit,     // of the coat's directional albedo
}

struct BrdfSample {
    w_i: vec3f,
    weight: vec3f,  // f_r cos / pdf
    pdf: f32,       // 1/sr; 0: the sample is invalid
}

fn brdf_metallic_roughness(base_color: vec3f, metallic: f32, roughness: f32) -> Brdf {
    let alpha = max(roughness * roughness, MIN_ALPHA);
    let fit = fit_coat(alpha);
    // Schlick's formula has a cosine-weighted hemispherical mean of (20 F0 + 1) / 21.
    let fresnel = (20.0 * base_color + 1.0) / 21.0;
    let multiple = fresnel * fresnel * (metallic * (1.0 - fit.mean_missing)) / (1.0 - fresnel * fit.mean_missing);
    return Brdf(
        base_color * (1.0 - metallic), alpha, mix(vec3f(DIELECTRIC_F0), base_color, metallic), true, multiple, fit);
}

fn brdf_lambert(albedo: vec3f) -> Brdf {
    return Brdf(albedo, 1.0, vec3f(0.0), false, vec3f(0.0), no_coat());
}

fn fresnel_schlick(f0: vec3f, cosine: f32) -> vec3f {
    let m = clamp(1.0 - cosine, 0.0, 1.0);
    let m2 = m * m;
    return f0 + (1.0 - f0) * (m2 * m2 * m);
}

fn ggx_distribution(alpha: f32, cos_h: f32) -> f32 {
    // (1 - cos^2) + alpha^2 cos^2 instead of cos^2 (alpha^2 - 1) + 1: exact near the peak of narrow lobes.
    let a2 = alpha * alpha;
    let t = max(1.0 - cos_h * cos_h, 0.0) + a2 * cos_h * cos_h;
    return a2 / max(PI * t * t, 1e-30);
}

// Returns G2 / (4 cos_i cos_o), height-correlated.
fn smith_visibility(alpha: f32, cos_i: f32, cos_o: f32) -> f32 {
    let a2 = alpha * alpha;
    let o = cos_i * sqrt(cos_o * cos_o * (1.0 - a2) + a2);
    let i = cos_o * sqrt(cos_i * cos_i * (1.0 - a2) + a2);
    return 0.5 / max(i + o, 1e-30);
}

// Returns the density of visible normals reflected into w_i, 1/sr (Heitz 2018, eq. 17): G1(w_o) D / (4 cos_o).
fn ggx_pdf(alpha: f32, cos_h: f32, cos_o: f32) -> f32 {
    let a2 = alpha * alpha;
    let g1_over_2cos = 1.0 / (cos_o + sqrt(a2 + (1.0 - a2) * cos_o * cos_o));
    return 0.5 * g1_over_2cos * ggx_distribution(alpha, cos_h);
}

// Returns the share of light that the coat transmits to the base on its way in and out: T(w_i) T(w_o) / <T>.
fn transmitted_share(b: Brdf, i: CoatLoss, o: CoatLoss) -> f32 {
    return i.transmitted * o.transmitted / b.fit.mean_transmitted;
}

// Returns f_r of light that the coat scatters more than once, 1/sr.
fn multiple_scattering(b: Brdf, i: CoatLoss, o: CoatLoss) -> vec3f {
    return b.multiple * (INV_PI * i.missing * o.missing / b.fit.mean_missing);
}

// Returns the density by which multiple scattering is sampled, 1/sr: cos / (cos^2 + alpha^2), close to its M cos.
fn multiple_pdf(alpha: f32, cosine: f32) -> f32 {
    let a2 = alpha * alpha;
    return INV_PI * cosine / ((cosine * cosine + a2) * log(1.0 + 1.0 / a2));
}

// Probabilities of the lobes that samples are drawn from; that of multiple scattering is the rest.
struct LobeShares {
    single: f32,
    base: f32,
}

// Returns shares in proportion to the lobes' reflectance.
fn lobe_shares(b: Brdf, cos_o: f32, o: CoatLoss) -> LobeShares {
    let single = luminance(fresnel_schlick(b.f0, cos_o)) * (1.0 - o.missing);
    let base = luminance(b.diffuse) * o.transmitted;
    let multiple = luminance(b.multiple) * o.missing;
    // A coat over a base gets at least a quarter and at most three, so neither starves where the estimate is off.
    let share = clamp(single / max(single + base + multiple, 1e-30), 0.25, select(1.0, 0.75, base > 0.0));
    return LobeShares(share, (1.0 - share) * select(0.0, base / max(base + multiple, 1e-30), base > 0.0));
}

// Returns f_r, 1/sr; zero if either direction is below the surface. `o`: the coat's loss towards w_o.
fn scattered(b: Brdf, w_o: vec3f, o: CoatLoss, w_i: vec3f) -> vec3f {
    if (w_i.z <= 0.0 || w_o.z <= 0.0) {
        return vec3f(0.0);
    }
    if (!b.glossy) {
        return b.diffuse * INV_PI;
    }
    let i = coat_loss(b.fit, b.alpha, w_i.z);
    let h = normalize(w_i + w_o);
    let lobe = ggx_distribution(b.alpha, h.z) * smith_visibility(b.alpha, w_i.z, w_o.z);
    let glossy = fresnel_schlick(b.f0, dot(w_i, h)) * lobe + multiple_scattering(b, i, o);
    return b.diffuse * (INV_PI * transmitted_share(b, i, o)) + glossy;
}

// Returns (f_r, pdf of sample_brdf in w); zero if either direction is below the surface.
fn evaluate_brdf(b: Brdf, w_o: vec3f, w_i: vec3f) -> vec4f {
    if (w_i.z <= 0.0 || w_o.z <= 0.0) {
        return vec4f(0.0);
    }
    let cosine_pdf = w_i.z * INV_PI;
    if (!b.glossy) {
        return vec4f(b.diffuse * INV_PI, cosine_pdf);
    }
    let o = coat_loss(b.fit, b.alpha, w_o.z);
    let h = normalize(w_i + w_o);
    let shares = lobe_shares(b, w_o.z, o);
    let pdf = shares.single * ggx_pdf(b.alpha, h.z, w_o.z) + shares.base * cosine_pdf
        + (1.0 - shares.single - shares.base) * multiple_pdf(b.alpha, w_i.z);
    return vec4f(scattered(b, w_o, o, w_i), pdf);
}

// Draws w_i with a density close to f_r cos; `choice` in [0, 1) picks the lobe.
fn sample_brdf(b: Brdf, w_o: vec3f, u: vec2f, choice: f32) -> BrdfSample {
    if (!b.glossy) {
        let w = sample_cosine_hemisphere(u);
        return BrdfSample(w, b.diffuse, w.z * INV_PI);
    }
    var w_i: vec3f;
    let shares = lobe_shares(b, w_o.z, coat_loss(b.fit, b.alpha, w_o.z));
    if (choice < shares.single) {
        // Sample a visible normal by a spherical cap (Dupuy and Benyoub 2023, "Sampling Visible GGX Normals with
        // Spherical Caps").
        let stretched = normalize(vec3f(b.alpha * w_o.xy, w_o.z));
        let z = fma(1.0 - u.x, 1.0 + stretched.z, -stretched.z);
        let sine = sqrt(clamp(1.0 - z * z, 0.0, 1.0));
        let phi = TWO_PI * u.y;
        let cap = vec3f(sine * cos(phi), sine * sin(phi), z) + stretched;
        let h = normalize(vec3f(b.alpha * cap.xy, max(cap.z, 1e-7)));
        w_i = reflect(-w_o, h);
    } else if (choice < shares.single + shares.base) {
        w_i = sample_cosine_hemisphere(u);
    } else {
        // Invert the distribution of multiple_pdf, log(1 + cos^2 / alpha^2) / log(1 + 1 / alpha^2).
        let a2 = b.alpha * b.alpha;
        let squared = min(a2 * (exp(u.x * log(1.0 + 1.0 / a2)) - 1.0), 1.0);
        let sine = sqrt(1.0 - squared);
        w_i = vec3f(sine * cos(TWO_PI * u.y), sine * sin(TWO_PI * u.y), sqrt(max(squared, 0.0)));
    }
    let f = evaluate_brdf(b, w_o, w_i);
    if (f.w <= 0.0) {
        return BrdfSample(w_i, vec3f(0.0), 0.0);
    }
    return BrdfSample(w_i, f.rgb * (w_i.z / f.w), f.w);
}
