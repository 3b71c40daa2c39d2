// The response of a surface's coat to a source, such as a VPL: the GGX lobe, widened by the angle that the source's
// disc subtends. The widened lobe mirrors a source as bright as its disc, without a spike. Errs blurry, by less than
// the distance between sources.
#import "common/brdf.wgsl"

struct Shine {
    fresnel: vec3f,
    lobe: f32,       // D V, 1/sr
}

// Returns the coat's response to a source. `to_source`: metres; `squared`: its squared length plus the geometry term's
// bound, m2; `area`: of the source's disc, m2.
fn shine_of(brdf: Brdf, normal: vec3f, to_eye: vec3f, to_source: vec3f, squared: f32, area: f32) -> Shine {
    let w_i = to_source * inverseSqrt(max(dot(to_source, to_source), 1e-30));
    let sum = w_i + to_eye;
    let h = sum * inverseSqrt(max(dot(sum, sum), 1e-30));
    let cos_i = max(dot(normal, w_i), 0.0);
    let cos_o = dot(normal, to_eye);
    // The widened lobe of a mirror has D = 1 / (pi alpha^2) = 4 d^2 cos_o / area, and D V E cos_i is the disc's
    // radiance.
    let spanned = 0.25 * INV_PI * area / max(squared * cos_o, 1e-30);
    let alpha = sqrt(min(brdf.alpha * brdf.alpha + spanned, 1.0));
    let lobe = ggx_distribution(alpha, max(dot(normal, h), 0.0)) * smith_visibility(alpha, cos_i, max(cos_o, 0.0));
    let lit = brdf.glossy && cos_o > 0.0;
    return Shine(
        select(vec3f(0.0), fresnel_schlick(brdf.f0, dot(w_i, h)), brdf.glossy), select(0.0, lobe, lit));
}

// Returns the share of light that the coat transmits to the base; `to_light` has any length.
fn passed_share(brdf: Brdf, to_light: vec3f, to_eye: vec3f) -> vec3f {
    let w_i = to_light * inverseSqrt(max(dot(to_light, to_light), 1e-30));
    let sum = w_i + to_eye;
    let h = sum * inverseSqrt(max(dot(sum, sum), 1e-30));
    return select(vec3f(1.0), 1.0 - fresnel_schlick(brdf.f0, dot(w_i, h)), brdf.glossy);
}

// Returns the coat's reflectance: glossy light is divided by it before a blur and multiplied after (demodulation).
fn coat_tint(brdf: Brdf, normal: vec3f, to_eye: vec3f) -> vec3f {
    // Black metals reflect 0: keep the divisor above it.
    return max(fresnel_schlick(brdf.f0, saturate(dot(normal, to_eye))), vec3f(0.01));
}
