// glTF metallic-roughness BRDF: Lambert under a GGX coat, and its sampling.
//
// glTF 2.0, appendix B.3.5: f = (1 - F) c_diff / pi + F D V, with F = F0 + (1 - F0)(1 - v.h)^5, D and V the GGX
// distribution and the height-correlated Smith visibility (Heitz 2014, eq. 99). Single scattering only: a metal of
// roughness 1 seen straight on reflects 1 - ln 2 = 31 % (errs dark, as the glTF model does); the
// sum of base and coat is not conserved: a smooth white dielectric returns up to 1.4 at grazing angles (errs bright, as
// the model does). All directions are in the local frame, normal +Z.
#import "common/math.wgsl"
#import "common/sampling.wgsl"

// Below this GGX alpha the lobe is narrower than float32 half vectors resolve (roughness 0.032).
const MIN_ALPHA: f32 = 0.001;

struct Brdf {
    diffuse: vec3f,  // albedo of the Lambert part, (1 - metallic) base_color
    alpha: f32,      // GGX width, roughness squared
    f0: vec3f,       // reflectance at normal incidence
    glossy: bool,    // false: pure Lambert, no coat
}

struct BrdfSample {
    w_i: vec3f,
    weight: vec3f,  // f_r cos / pdf
    pdf: f32,       // 1/sr; 0: the sample is invalid
}

fn brdf_metallic_roughness(base_color: vec3f, metallic: f32, roughness: f32) -> Brdf {
    let alpha = max(roughness * roughness, MIN_ALPHA);
    return Brdf(base_color * (1.0 - metallic), alpha, mix(vec3f(0.04), base_color, metallic), true);
}

fn brdf_lambert(albedo: vec3f) -> Brdf {
    return Brdf(albedo, 1.0, vec3f(0.0), false);
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

// Returns the probability of sampling the coat: its reflectance over the sum of reflectance and diffuse albedo.
fn glossy_probability(b: Brdf, cos_o: f32) -> f32 {
    if (!b.glossy) {
        return 0.0;
    }
    let coat = luminance(fresnel_schlick(b.f0, cos_o));
    let base = luminance(b.diffuse);
    if (base <= 0.0) {
        return 1.0;
    }
    // Each lobe gets at least a quarter, so neither starves where the estimate is off.
    return clamp(coat / (coat + base), 0.25, 0.75);
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
    let h = normalize(w_i + w_o);
    let fresnel = fresnel_schlick(b.f0, dot(w_i, h));
    let glossy = ggx_distribution(b.alpha, h.z) * smith_visibility(b.alpha, w_i.z, w_o.z);
    let share = glossy_probability(b, w_o.z);
    let pdf = mix(cosine_pdf, ggx_pdf(b.alpha, h.z, w_o.z), share);
    return vec4f((1.0 - fresnel) * b.diffuse * INV_PI + fresnel * glossy, pdf);
}

// Draws w_i with a density close to f_r cos; `choice` in [0, 1) picks the lobe.
fn sample_brdf(b: Brdf, w_o: vec3f, u: vec2f, choice: f32) -> BrdfSample {
    if (!b.glossy) {
        let w = sample_cosine_hemisphere(u);
        return BrdfSample(w, b.diffuse, w.z * INV_PI);
    }
    var w_i: vec3f;
    if (choice < glossy_probability(b, w_o.z)) {
        // Sample a visible normal by a spherical cap (Dupuy and Benyoub 2023, "Sampling Visible GGX Normals with
        // Spherical Caps").
        let stretched = normalize(vec3f(b.alpha * w_o.xy, w_o.z));
        let z = fma(1.0 - u.x, 1.0 + stretched.z, -stretched.z);
        let sine = sqrt(clamp(1.0 - z * z, 0.0, 1.0));
        let phi = TWO_PI * u.y;
        let cap = vec3f(sine * cos(phi), sine * sin(phi), z) + stretched;
        let h = normalize(vec3f(b.alpha * cap.xy, max(cap.z, 1e-7)));
        w_i = reflect(-w_o, h);
    } else {
        w_i = sample_cosine_hemisphere(u);
    }
    let f = evaluate_brdf(b, w_o, w_i);
    if (f.w <= 0.0) {
        return BrdfSample(w_i, vec3f(0.0), 0.0);
    }
    return BrdfSample(w_i, f.rgb * (w_i.z / f.w), f.w);
}
