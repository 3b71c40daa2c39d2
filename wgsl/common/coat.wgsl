// Light of a VPL on a surface's coat. A VPL is a disc, so the lobe is widened by what the disc spans: then the mirror
// image of a VPL is as bright as the disc, and none makes a spike. Errs blurry, by less than the distance between VPLs.
#import "common/brdf.wgsl"

struct Shine {
    fresnel: vec3f,
    lobe: f32,       // D V, 1/sr
}

// `to_vpl` in metres, `squared` its length squared with the bound of the geometry term.
fn shine_of(brdf: Brdf, normal: vec3f, to_eye: vec3f, to_vpl: vec3f, squared: f32, area: f32) -> Shine {
    let w_i = to_vpl * inverseSqrt(max(dot(to_vpl, to_vpl), 1e-30));
    let sum = w_i + to_eye;
    let h = sum * inverseSqrt(max(dot(sum, sum), 1e-30));
    let cos_i = max(dot(normal, w_i), 0.0);
    let cos_o = dot(normal, to_eye);
    // D of a mirror is then 1 / (pi alpha^2) = 4 d^2 cos_o / area, and D V E cos_i the disc's radiance.
    let spanned = 0.25 * INV_PI * area / max(squared * cos_o, 1e-30);
    let alpha = sqrt(min(brdf.alpha * brdf.alpha + spanned, 1.0));
    let lobe = ggx_distribution(alpha, max(dot(normal, h), 0.0)) * smith_visibility(alpha, cos_i, max(cos_o, 0.0));
    let lit = brdf.glossy && cos_o > 0.0;
    return Shine(
        select(vec3f(0.0), fresnel_schlick(brdf.f0, dot(w_i, h)), brdf.glossy), select(0.0, lobe, lit));
}

// Returns what a coat lets through of light from where `way` leads, of any length.
fn passed_share(brdf: Brdf, way: vec3f, to_eye: vec3f) -> vec3f {
    let w_i = way * inverseSqrt(max(dot(way, way), 1e-30));
    let sum = w_i + to_eye;
    let h = sum * inverseSqrt(max(dot(sum, sum), 1e-30));
    return select(vec3f(1.0), 1.0 - fresnel_schlick(brdf.f0, dot(w_i, h)), brdf.glossy);
}

// Returns what glossy light is divided by while it is averaged over neighbours, so that their colours stay apart.
fn coat_tint(brdf: Brdf, normal: vec3f, to_eye: vec3f) -> vec3f {
    // Above zero: metals may be black.
    return max(fresnel_schlick(brdf.f0, saturate(dot(normal, to_eye))), vec3f(0.01));
}
