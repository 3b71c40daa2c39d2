// The base of a material, below a clear coat and sheen: Lambert under a GGX coat (glTF metallic-roughness), conserving
// energy, or a transmitted lobe instead of Lambert's.
//
//   f = F D V + F_ms M(w_i) M(w_o) / (pi <M>) + (1 - m) (1 - t) c T(w_i) T(w_o) / (pi <T>),  F = F0 + (F90 - F0)(1 - v.h)^5
// F D V is glTF's specular term (appendix B.3): GGX, height-correlated Smith (Heitz 2014, eq. 99), F0 = mix(f0, c, m),
// F90 = mix(f90, 1, m); f0 and f90 of the dielectric: 0.04 and 1, or KHR_materials_ior and _specular.
// It scatters once. What a metal's microfacets scatter again, M, adds the second term (Kulla and Conty 2017,
// "Revisiting Physically Based Shading at Imageworks"), F_ms = m <F>^2 (1 - <M>) / (1 - <F> <M>), <F> = (20 c + 1) / 21.
// The base gets what a dielectric's coat transmits, T, on the way in and out (Kelemen and Szirmay-Kalos 2001), as
// appendix B.2 mixes dielectric and metal; the approximation in B.3.5 takes 1 - F of the mixture instead. M and T:
// `common/coat_albedo.wgsl`; <> are their means. T is that of the largest component of f0, as in KHR_materials_specular.
// Reciprocal; a white surface reflects 1 at every roughness and metalness, other ones less; errs by the fits, at most
// 0.25 %. The share t of a dielectric's base transmits (`common/transmission.wgsl`), coloured by c.
// Anisotropy (KHR_materials_anisotropy) stretches D and V. All directions are in the local frame, normal +Z.
#import "common/math.wgsl"
#import "common/layers.wgsl"
#import "common/ggx.wgsl"
#import "common/coat_albedo.wgsl"
#import "common/anisotropy.wgsl"
#import "common/interface.wgsl"
#import "common/clearcoat.wgsl"

struct Brdf {
    diffuse: vec3f,           // albedo of the Lambert part, (1 - metallic) (1 - transmission) base_color
    alpha: f32,               // GGX width, roughness squared; geometric mean of both axes if anisotropic
    f0: vec3f,                // reflectance at normal incidence
    glossy: bool,             // false: pure Lambert, no coat
    multiple: vec3f,          // F_ms, of light that the coat scatters more than once
    fit: CoatFit,             // of the coat's directional albedo; its f0 and f90 are those of the dielectric
    f90: f32,                 // reflectance at grazing incidence
    stretch: f32,             // alpha along the tangent over `alpha`, and `alpha` over that across; 1: isotropic
    stretched_fit: CoatFit,   // in place of `fit`, of the anisotropic lobe
    tangent: vec2f,           // direction of stretch, unit, local x and y
    clearcoat: Clearcoat,     // share 0: none
    sheen: vec3f,             // colour; 0: none
    sheen_alpha: f32,
    transmitted: vec3f,       // colour of what passes to the other side; 0: opaque
    transmitted_alpha: f32,   // GGX width of a thin wall's transmitted lobe
    transmitted_fit: CoatFit,
    eta: f32,                 // index of refraction on the other side over that on the viewer's; 0: a thin wall
}

fn brdf_metallic_roughness(base_color: vec3f, metallic: f32, roughness: f32) -> Brdf {
    return brdf_metallic_alpha(base_color, metallic, max(roughness * roughness, MIN_ALPHA));
}

fn brdf_metallic_alpha(base_color: vec3f, metallic: f32, alpha: f32) -> Brdf {
    let fit = fit_coat(alpha);
    let multiple = multiple_albedo(base_color, metallic, fit.mean_missing);
    var b = brdf_lobe(alpha, mix(vec3f(DIELECTRIC_F0), base_color, metallic));
    b.diffuse = base_color * (1.0 - metallic);
    b.multiple = multiple;
    b.fit = fit;
    return b;
}

// Returns F_ms.
fn multiple_albedo(base_color: vec3f, metallic: f32, mean_missing: f32) -> vec3f {
    // Schlick's formula has a cosine-weighted hemispherical mean of (20 F0 + 1) / 21.
    let fresnel = (20.0 * base_color + 1.0) / 21.0;
    return fresnel * fresnel * (metallic * (1.0 - mean_missing)) / (1.0 - fresnel * mean_missing);
}

fn brdf_lambert(albedo: vec3f) -> Brdf {
    var b = brdf_lobe(1.0, vec3f(0.0));
    b.diffuse = albedo;
    b.glossy = false;
    return b;
}

// Returns a GGX lobe alone, which scatters once.
fn brdf_lobe(alpha: f32, f0: vec3f) -> Brdf {
    return Brdf(
        vec3f(0.0), alpha, f0, true, vec3f(0.0), no_coat(), 1.0, 1.0, no_coat(), vec2f(1.0, 0.0), no_clearcoat(),
        vec3f(0.0), 1.0, vec3f(0.0), 1.0, no_coat(), 0.0);
}

// Returns the lobe's widths along its axes.
fn lobe_axes(b: Brdf, alpha: f32) -> vec2f {
    return select(vec2f(alpha), vec2f(alpha * b.stretch, alpha / b.stretch), HAS_ANISOTROPY);
}

// Returns a direction of the local frame in the lobe's axes.
fn to_axes(b: Brdf, w: vec3f) -> vec3f {
    return select(w, vec3f(dot(b.tangent, w.xy), b.tangent.x * w.y - b.tangent.y * w.x, w.z), HAS_ANISOTROPY);
}

fn from_axes(b: Brdf, w: vec3f) -> vec3f {
    let turned = vec3f(b.tangent * w.x + vec2f(-b.tangent.y, b.tangent.x) * w.y, w.z);
    return select(w, turned, HAS_ANISOTROPY);
}

// Returns D V of half vector h, 1/sr, in the local frame.
fn lobe_of(b: Brdf, alpha: f32, w_o: vec3f, w_i: vec3f, h: vec3f) -> f32 {
    if (HAS_ANISOTROPY) {
        let axes = lobe_axes(b, alpha);
        return ggx_distribution_of(axes, to_axes(b, h)) * smith_visibility_of(axes, to_axes(b, w_i), to_axes(b, w_o));
    }
    return ggx_distribution(alpha, h.z) * smith_visibility(alpha, w_i.z, w_o.z);
}

// Returns the density of visible normals reflected at h, 1/sr.
fn lobe_pdf(b: Brdf, alpha: f32, w_o: vec3f, h: vec3f) -> f32 {
    if (HAS_ANISOTROPY) {
        return ggx_pdf_of(lobe_axes(b, alpha), to_axes(b, h), to_axes(b, w_o));
    }
    return ggx_pdf(alpha, h.z, w_o.z);
}

fn sample_lobe_normal(b: Brdf, alpha: f32, w_o: vec3f, u: vec2f) -> vec3f {
    return from_axes(b, sample_visible_normal(lobe_axes(b, alpha), to_axes(b, w_o), u));
}

// Returns F of the base's coat; 1 beyond the critical angle.
fn fresnel_of(b: Brdf, cosine: f32) -> vec3f {
    var c = cosine;
    if (HAS_VOLUMES) {
        c = thinner_side(b.eta, cosine);
        if (c < 0.0) {
            return vec3f(1.0);
        }
    }
    if (HAS_SPECULAR) {
        return fresnel_schlick_to(b.f0, b.f90, c);
    }
    return fresnel_schlick(b.f0, c);
}

// Returns 1 - F of the dielectric: the share that the transmitted lobe gets.
fn unreflected(b: Brdf, cosine: f32) -> f32 {
    let c = thinner_side(b.eta, cosine);
    return select(0.0, 1.0 - fresnel_schlick_to(vec3f(b.fit.f0), b.fit.f90, c).x, c >= 0.0);
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

// Inverts the distribution of multiple_pdf, log(1 + cos^2 / alpha^2) / log(1 + 1 / alpha^2).
fn sample_multiple(alpha: f32, u: vec2f) -> vec3f {
    let a2 = alpha * alpha;
    let squared = min(a2 * (exp(u.x * log(1.0 + 1.0 / a2)) - 1.0), 1.0);
    let sine = sqrt(1.0 - squared);
    return vec3f(sine * cos(TWO_PI * u.y), sine * sin(TWO_PI * u.y), sqrt(max(squared, 0.0)));
}

// Returns f_r of the base for directions above the surface. `o`: the coat's loss towards w_o.
fn base_reflects(b: Brdf, w_o: vec3f, o: CoatLoss, w_i: vec3f) -> vec3f {
    let h = normalize(w_i + w_o);
    let once = fresnel_of(b, dot(w_i, h)) * lobe_of(b, b.alpha, w_o, w_i, h);
    if (HAS_ANISOTROPY && b.stretch > 1.0) {
        var stretched = b;
        stretched.fit = b.stretched_fit;
        let axes = lobe_axes(b, b.alpha);
        let to_i = anisotropic_loss(b.stretched_fit, axes, to_axes(b, w_i));
        let to_o = anisotropic_loss(b.stretched_fit, axes, to_axes(b, w_o));
        return b.diffuse * (INV_PI * transmitted_share(stretched, to_i, to_o)) + once
            + multiple_scattering(stretched, to_i, to_o);
    }
    let i = coat_loss(b.fit, b.alpha, w_i.z);
    return b.diffuse * (INV_PI * transmitted_share(b, i, o)) + (once + multiple_scattering(b, i, o));
}

// Probabilities of the base's lobes that samples are drawn from; that of multiple scattering is the rest.
struct LobeShares {
    single: f32,  // microfacets: what they reflect, and what those of a solid refract
    base: f32,
}

// Returns shares in proportion to the lobes' reflectance.
fn lobe_shares(b: Brdf, cos_o: f32, o: CoatLoss) -> LobeShares {
    var fresnel = luminance(fresnel_of(b, cos_o));
    if (HAS_VOLUMES && b.eta > 0.0) {
        fresnel += luminance(b.transmitted) * unreflected(b, cos_o);
    }
    let single = fresnel * (1.0 - o.missing);
    let base = luminance(b.diffuse) * o.transmitted;
    let multiple = luminance(b.multiple) * o.missing;
    // A coat over a base gets at least a quarter and at most three, so neither starves where the estimate is off.
    let share = clamp(single / max(single + base + multiple, 1e-30), 0.25, select(1.0, 0.75, base > 0.0));
    return LobeShares(share, (1.0 - share) * select(0.0, base / max(base + multiple, 1e-30), base > 0.0));
}
