// Light that passes a rough interface between two media, or a thin wall.
//
// Solid (Walter et al. 2007, "Microfacet Models for Refraction through Rough Surfaces", eq. 16, 17, 21), for radiance:
//   f = |i.h| |o.h| / (cos_i cos_o) (1 - F) G1(i) G1(o) D / (eta i.h + o.h)^2,  h = -(o + eta i) / |o + eta i|
// eta: index of refraction on w_i's side over that on w_o's. f(i, o) = f(o, i) / eta^2: radiance grows by the square of the
// index. Light that microfacets scatter again is lost, as in Mitsuba's `roughdielectric`.
// Thin (KHR_materials_transmission): the reflected lobe mirrored through the wall, with what microfacets scatter again:
//   f = (1 - F) D V(i', o) + M(i) M(o) / (pi <M>),  i' = (i.x, i.y, -i.z)
// F is that of one interface: a wall reflects F and passes 1 - F, as Khronos' viewer has it. A slab of glass reflects
// 2 F / (1 + F). Inside the denser medium F is that of the refracted angle outside, and 1 beyond the critical angle.
#import "common/base.wgsl"

// What a transmitted lobe sends to the other side.
struct Passed {
    f: vec3f,       // 1/sr
    pdf: f32,       // thin: of sample_thin; solid: of refracted visible normals, times the chance of refraction
}

// Returns the share of a thin wall's transmitted light that its microfacets scatter again.
fn thin_again(b: Brdf, cos_o: f32) -> f32 {
    if (HAS_ANISOTROPY && b.stretch > 1.0) {
        return 0.0;  // it is lost
    }
    let loss = coat_loss(b.transmitted_fit, b.transmitted_alpha, cos_o);
    return saturate(loss.missing / max(loss.transmitted, 1e-6));
}

fn thin_passes(b: Brdf, w_o: vec3f, w_i: vec3f) -> Passed {
    let alpha = b.transmitted_alpha;
    let mirrored = vec3f(w_i.xy, -w_i.z);
    let h = normalize(mirrored + w_o);
    let i = coat_loss(b.transmitted_fit, alpha, mirrored.z);
    let o = coat_loss(b.transmitted_fit, alpha, w_o.z);
    let is_lost = HAS_ANISOTROPY && b.stretch > 1.0;
    let again = select(INV_PI * i.missing * o.missing / b.transmitted_fit.mean_missing, 0.0, is_lost);
    let once = unreflected(b, dot(mirrored, h)) * lobe_of(b, alpha, w_o, mirrored, h);
    let pdf = mix(lobe_pdf(b, alpha, w_o, h), multiple_pdf(alpha, mirrored.z), thin_again(b, w_o.z));
    return Passed(b.transmitted * (once + again), pdf);
}

// `choice` in [0, 1) decides whether microfacets scatter once.
fn sample_thin(b: Brdf, w_o: vec3f, u: vec2f, choice: f32) -> vec3f {
    let alpha = b.transmitted_alpha;
    var w_i = sample_multiple(alpha, u);
    if (choice >= thin_again(b, w_o.z)) {
        w_i = reflect(-w_o, sample_lobe_normal(b, alpha, w_o, u));
    }
    return vec3f(w_i.xy, -w_i.z);
}

// Returns the probability that a microfacet of a solid reflects.
fn reflection_chance(b: Brdf, cosine: f32) -> f32 {
    let reflected = luminance(fresnel_of(b, cosine));
    let passed = luminance(b.transmitted) * unreflected(b, cosine);
    return select(1.0, reflected / max(reflected + passed, 1e-30), passed > 0.0);
}

fn solid_passes(b: Brdf, w_o: vec3f, w_i: vec3f) -> Passed {
    let h = refraction_half(b.eta, w_o, w_i);
    let o_h = dot(w_o, h);
    let i_h = dot(w_i, h);
    if (o_h <= 0.0 || i_h >= 0.0) {
        return Passed(vec3f(0.0), 0.0);
    }
    let axes = lobe_axes(b, b.alpha);
    let visible = 4.0 * o_h * lobe_pdf(b, b.alpha, w_o, h);  // G1(o) D o.h / cos_o
    let masked = 2.0 / (abs(w_i.z) + stretched_length(axes, to_axes(b, w_i)));  // G1(i) / cos_i
    let across = b.eta * i_h + o_h;
    let jacobian = abs(i_h) / max(across * across, 1e-30);
    let f = b.transmitted * (unreflected(b, o_h) * visible * masked * jacobian);
    return Passed(f, (1.0 - reflection_chance(b, o_h)) * visible * jacobian * b.eta * b.eta);
}
