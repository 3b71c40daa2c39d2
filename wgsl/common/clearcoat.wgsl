// A clear coat (KHR_materials_clearcoat): a GGX lobe with F0 = 0.04 and a normal n_c of its own over all other lobes.
//
//   f = c F D V (n_c . w_i) / (n . w_i),  below it: times min(t(w_i), t(w_o)),  t = 1 - c (1 - T(|n_c . w|))
// T: what the coat transmits (`coat_albedo.wgsl`). A lobe below reflects at most t(w_o) of what it would reflect uncovered,
// so the sum of both is at most 1; and it is reciprocal where n_c = n. Khronos' viewer takes 1 - c F(n_c . w_o).
// Errs dark: light that the coat reflects back down is lost. Departure: emission below the coat is not dimmed; Khronos
// multiplies it by 1 - c F(n_c . w_o).
#import "common/ggx.wgsl"
#import "common/coat_albedo.wgsl"

struct Clearcoat {
    share: f32,     // c, of the surface that is covered
    alpha: f32,
    normal: vec3f,  // unit, local frame
    fit: CoatFit,
}

fn no_clearcoat() -> Clearcoat {
    return Clearcoat(0.0, 1.0, vec3f(0.0, 0.0, 1.0), no_coat());
}

fn clearcoat_of(share: f32, roughness: f32, normal: vec3f) -> Clearcoat {
    let alpha = max(roughness * roughness, MIN_ALPHA);
    return Clearcoat(share, alpha, normal, fit_coat(alpha));
}

// Returns the share of light in a direction that passes the coat.
fn clearcoat_passes(c: Clearcoat, w: vec3f) -> f32 {
    let loss = coat_loss(c.fit, c.alpha, abs(dot(c.normal, w)));
    return 1.0 - c.share * saturate(1.0 - loss.transmitted);
}

// Returns (f_r, pdf of sample_clearcoat); w_i, w_o above the surface.
fn evaluate_clearcoat(c: Clearcoat, w_o: vec3f, w_i: vec3f) -> vec2f {
    let cos_i = dot(c.normal, w_i);
    let cos_o = dot(c.normal, w_o);
    if (cos_i <= 0.0 || cos_o <= 0.0) {
        return vec2f(0.0);
    }
    let h = normalize(w_i + w_o);
    let cos_h = saturate(dot(c.normal, h));
    let fresnel = fresnel_schlick(vec3f(DIELECTRIC_F0), dot(w_i, h)).x;
    let f = c.share * fresnel * ggx_distribution(c.alpha, cos_h) * smith_visibility(c.alpha, cos_i, cos_o);
    return vec2f(f * (cos_i / max(w_i.z, 1e-30)), ggx_pdf(c.alpha, cos_h, cos_o));
}

// Draws w_i by the visible normals; it may lie below the surface.
fn sample_clearcoat(c: Clearcoat, w_o: vec3f, u: vec2f) -> vec3f {
    let frame = frame_from_normal(c.normal);
    return reflect(-w_o, frame * sample_visible_normal(vec2f(c.alpha), w_o * frame, u));
}
