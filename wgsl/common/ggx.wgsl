// The GGX microfacet lobe: distribution D, masking and shadowing, Fresnel term, sampling of visible normals.
//
//   D = 1 / (pi a_x a_y ((h_x / a_x)^2 + (h_y / a_y)^2 + h_z^2)^2),  V = G2 / (4 cos_i cos_o)
// G2 is Smith's, height-correlated (Heitz 2014, eq. 99, and eq. 87 for the anisotropic Lambda). Exact.
// Anisotropic forms take vectors in the lobe's axes, isotropic ones cosines.
#import "common/math.wgsl"

// Below this GGX alpha the lobe is narrower than float32 half vectors resolve (roughness 0.032).
const MIN_ALPHA: f32 = 0.001;

fn fresnel_schlick(f0: vec3f, cosine: f32) -> vec3f {
    let m = clamp(1.0 - cosine, 0.0, 1.0);
    let m2 = m * m;
    return f0 + (1.0 - f0) * (m2 * m2 * m);
}

// Returns Schlick's formula with a reflectance f90 at grazing incidence.
fn fresnel_schlick_to(f0: vec3f, f90: f32, cosine: f32) -> vec3f {
    let m = clamp(1.0 - cosine, 0.0, 1.0);
    let m2 = m * m;
    return f0 + (f90 - f0) * (m2 * m2 * m);
}

fn ggx_distribution(alpha: f32, cos_h: f32) -> f32 {
    // (1 - cos^2) + alpha^2 cos^2 instead of cos^2 (alpha^2 - 1) + 1: exact near the peak of narrow lobes.
    let a2 = alpha * alpha;
    let t = max(1.0 - cos_h * cos_h, 0.0) + a2 * cos_h * cos_h;
    return a2 / max(PI * t * t, 1e-30);
}

fn ggx_distribution_of(axes: vec2f, h: vec3f) -> f32 {
    let across = h.xy / axes;
    let t = dot(across, across) + h.z * h.z;
    // t is at least 1 for axes up to 1.
    return 1.0 / (PI * axes.x * axes.y * max(t * t, 0.01));
}

// Returns G2 / (4 cos_i cos_o), height-correlated.
fn smith_visibility(alpha: f32, cos_i: f32, cos_o: f32) -> f32 {
    let a2 = alpha * alpha;
    let o = cos_i * sqrt(cos_o * cos_o * (1.0 - a2) + a2);
    let i = cos_o * sqrt(cos_i * cos_i * (1.0 - a2) + a2);
    return 0.5 / max(i + o, 1e-30);
}

// Returns cos_w (1 + 2 Lambda(w)) = |(a_x w_x, a_y w_y, w_z)|.
fn stretched_length(axes: vec2f, w: vec3f) -> f32 {
    return length(vec3f(axes * w.xy, w.z));
}

fn smith_visibility_of(axes: vec2f, w_i: vec3f, w_o: vec3f) -> f32 {
    return 0.5 / max(w_i.z * stretched_length(axes, w_o) + w_o.z * stretched_length(axes, w_i), 1e-30);
}

// Returns the density of visible normals reflected into w_i, 1/sr (Heitz 2018, eq. 17): G1(w_o) D / (4 cos_o).
fn ggx_pdf(alpha: f32, cos_h: f32, cos_o: f32) -> f32 {
    let a2 = alpha * alpha;
    let g1_over_2cos = 1.0 / (cos_o + sqrt(a2 + (1.0 - a2) * cos_o * cos_o));
    return 0.5 * g1_over_2cos * ggx_distribution(alpha, cos_h);
}

fn ggx_pdf_of(axes: vec2f, h: vec3f, w_o: vec3f) -> f32 {
    return 0.5 * ggx_distribution_of(axes, h) / (w_o.z + stretched_length(axes, w_o));
}

// Draws a visible normal by a spherical cap (Dupuy and Benyoub 2023, "Sampling Visible GGX Normals with Spherical Caps").
fn sample_visible_normal(axes: vec2f, w_o: vec3f, u: vec2f) -> vec3f {
    let stretched = normalize(vec3f(axes * w_o.xy, w_o.z));
    let z = fma(1.0 - u.x, 1.0 + stretched.z, -stretched.z);
    let sine = sqrt(clamp(1.0 - z * z, 0.0, 1.0));
    let phi = TWO_PI * u.y;
    let cap = vec3f(sine * cos(phi), sine * sin(phi), z) + stretched;
    return normalize(vec3f(axes * cap.xy, max(cap.z, 1e-7)));
}
