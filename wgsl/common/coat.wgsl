// The response of a coated surface to a source, such as a VPL: what its coat reflects, with the GGX lobe widened by the
// angle that the source's disc subtends, and what it transmits to its base. The widened lobe mirrors a source as bright
// as its disc, without a spike. A clear coat and sheen belong to the coat. Errs blurry, by less than the distance between
// sources.
#import "common/brdf.wgsl"

struct Shine {
    coat: vec3f,       // f_r of the coat, 1/sr
    transmitted: f32,  // share of the light that the base gets
}

// Returns the coat's loss towards the eye; 0 and 1 for pure Lambert.
fn loss_to_eye(brdf: Brdf, normal: vec3f, to_eye: vec3f) -> CoatLoss {
    let loss = coat_loss(brdf.fit, brdf.alpha, dot(normal, to_eye));
    return CoatLoss(loss.missing, select(1.0, loss.transmitted, brdf.glossy));
}

// Returns the response to a source. `eye`: of loss_to_eye(); `to_source`: metres; `squared`: its squared length plus the
// geometry term's bound, m2; `area`: of the source's disc, m2.
fn shine_of(
    brdf: Brdf, eye: CoatLoss, normal: vec3f, to_eye: vec3f, to_source: vec3f, squared: f32, area: f32
) -> Shine {
    let w_i = to_source * inverseSqrt(max(dot(to_source, to_source), 1e-30));
    let sum = w_i + to_eye;
    let h = sum * inverseSqrt(max(dot(sum, sum), 1e-30));
    let cos_i = saturate(dot(normal, w_i));
    let cos_o = dot(normal, to_eye);
    // The widened lobe of a mirror has D = 1 / (pi alpha^2) = 4 d^2 cos_o / area, and D V E cos_i is the disc's
    // radiance.
    let spanned = 0.25 * INV_PI * area / max(squared * cos_o, 1e-30);
    let alpha = sqrt(min(brdf.alpha * brdf.alpha + spanned, 1.0));
    var lobe = 0.0;
    if (HAS_ANISOTROPY) {
        let frame = frame_from_normal(normal);
        lobe = lobe_of(
            brdf, alpha, vec3f((to_eye * frame).xy, max(cos_o, 0.0)), vec3f((w_i * frame).xy, cos_i), h * frame);
    } else {
        lobe = ggx_distribution(alpha, max(dot(normal, h), 0.0)) * smith_visibility(alpha, cos_i, max(cos_o, 0.0));
    }
    let loss = coat_loss(brdf.fit, brdf.alpha, cos_i);
    var coat = fresnel_of(brdf, dot(w_i, h)) * lobe + multiple_scattering(brdf, loss, eye);
    var transmitted = transmitted_share(brdf, loss, eye);
    if (HAS_CLEARCOAT || HAS_SHEEN) {
        var widened = brdf;
        widened.clearcoat.alpha = sqrt(min(brdf.clearcoat.alpha * brdf.clearcoat.alpha + spanned, 1.0));
        let above = layers_towards(widened, normal, to_eye, w_i);
        coat = above.f + above.passes * coat;
        transmitted *= above.passes;
    }
    return Shine(
        select(vec3f(0.0), coat, brdf.glossy && cos_o > 0.0), select(1.0, transmitted, brdf.glossy));
}

// Returns what layers above the base do to light from `w_i`, unit, world space.
fn layers_towards(brdf: Brdf, normal: vec3f, to_eye: vec3f, w_i: vec3f) -> Above {
    let frame = frame_from_normal(normal);
    let local_o = to_eye * frame;
    let local_i = w_i * frame;
    return layers_above(brdf, vec3f(local_o.xy, max(local_o.z, 1e-3)), vec3f(local_i.xy, max(local_i.z, 1e-3)));
}

// Returns the share of light from a direction of any length that the coat transmits to the base and back to the eye.
fn transmitted_from(brdf: Brdf, normal: vec3f, to_light: vec3f, to_eye: vec3f) -> f32 {
    let cosine = dot(normal, to_light) * inverseSqrt(max(dot(to_light, to_light), 1e-30));
    let loss = coat_loss(brdf.fit, brdf.alpha, cosine);
    var share = transmitted_share(brdf, loss, loss_to_eye(brdf, normal, to_eye));
    if (HAS_CLEARCOAT || HAS_SHEEN) {
        share *= layers_towards(brdf, normal, to_eye, normalize_or(to_light, normal)).passes;
    }
    return select(1.0, share, brdf.glossy);
}

// Returns the coat's reflectance: glossy light is divided by it before a blur and multiplied after (demodulation).
fn coat_tint(brdf: Brdf, normal: vec3f, to_eye: vec3f) -> vec3f {
    let cosine = saturate(dot(normal, to_eye));
    var tint = fresnel_of(brdf, cosine);
    if (HAS_SHEEN && max3(brdf.sheen) > 0.0) {
        tint = tint * sheen_passes(brdf.sheen, brdf.sheen_alpha, cosine)
            + brdf.sheen * min(sheen_albedo(brdf.sheen_alpha, cosine), 1.0);
    }
    if (HAS_CLEARCOAT && brdf.clearcoat.share > 0.0) {
        let passes = clearcoat_passes(brdf.clearcoat, to_eye * frame_from_normal(normal));
        tint = tint * passes + 1.0 - passes;
    }
    // Black metals reflect 0: keep the divisor above it.
    return max(tint, vec3f(0.01));
}
