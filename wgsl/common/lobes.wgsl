// A layered BRDF with wider lobes, and what its layers leave to those below.
#import "common/brdf.wgsl"

// Returns a BRDF whose lobes are no narrower than `least`.
fn widened_to(brdf: Brdf, least: f32) -> Brdf {
    var wide = brdf;
    if (!brdf.glossy) {
        return wide;
    }
    if (brdf.alpha < least) {
        wide.alpha = least;
        wide.fit = refitted(brdf.fit, least);
    }
    if (HAS_ANISOTROPY) {
        wide.stretch = clamp(brdf.stretch, 1.0, wide.alpha / least);
    }
    if (HAS_CLEARCOAT && brdf.clearcoat.share > 0.0 && brdf.clearcoat.alpha < least) {
        wide.clearcoat.alpha = least;
        wide.clearcoat.fit = fit_coat(least);
    }
    if (HAS_TRANSMISSION && brdf.transmitted_alpha < least) {
        wide.transmitted_alpha = least;
        wide.transmitted_fit = refitted(brdf.transmitted_fit, least);
    }
    return wide;
}

// Returns the fit at another alpha, of the same dielectric.
fn refitted(fit: CoatFit, alpha: f32) -> CoatFit {
    let plain = fit_coat(alpha);
    if (HAS_SPECULAR) {
        return fit_of_dielectric(plain, fit.f0, fit.f90);
    }
    return plain;
}

// What the base's coat does to light in a direction, in the local frame: its loss, and the share that its lobe would
// reflect without Fresnel's factor.
struct CoatShares {
    loss: CoatLoss,
    lobe: f32,
}

// `isotropic`: the share of a lobe of equal widths.
fn coat_shares(b: Brdf, w: vec3f, isotropic: f32) -> CoatShares {
    if (HAS_ANISOTROPY && b.stretch > 1.0) {
        let loss = anisotropic_loss(b.stretched_fit, lobe_axes(b, b.alpha), to_axes(b, w));
        // The fit's M is too small by about its margin.
        let margin = min(0.0494, 0.1516 * (1.0 - 1.0 / (b.stretch * b.stretch)));
        return CoatShares(loss, 1.0 - min(loss.missing + margin, 1.0));
    }
    return CoatShares(coat_loss(b.fit, b.alpha, w.z), isotropic);
}

// Cosines and weights of Gauss's rule of three points over the squared cosine: a mean over the hemisphere.
const RULE_COSINES: vec3f = vec3f(0.33572, 0.70711, 0.94198);
const RULE_WEIGHTS: vec3f = vec3f(5.0, 8.0, 5.0) / 18.0;

// What the layers above the base leave of light: what a mirror below them reflects, on both ways, and what a surface
// gets that is lit from all directions. Of the shares of both ways, the lesser counts, as in `common/brdf.wgsl`.
struct Left {
    mirrored: f32,
    scattered: f32,
}

fn no_layers_above() -> Left {
    return Left(1.0, 1.0);
}

// Returns what the clear coat leaves; `w_o`: in the local frame.
fn left_by_clearcoat(b: Brdf, w_o: vec3f) -> Left {
    if (!HAS_CLEARCOAT || b.clearcoat.share <= 0.0) {
        return no_layers_above();
    }
    let passes = clearcoat_passes(b.clearcoat, w_o);
    let c = b.clearcoat;
    let arriving = 1.0 - c.share * (1.0 - vec3f(
        coat_loss(c.fit, c.alpha, RULE_COSINES.x).transmitted, coat_loss(c.fit, c.alpha, RULE_COSINES.y).transmitted,
        coat_loss(c.fit, c.alpha, RULE_COSINES.z).transmitted));
    return Left(passes, dot(RULE_WEIGHTS, min(vec3f(passes), arriving)));
}

// Returns what sheen leaves.
fn left_by_sheen(b: Brdf, cosine: f32) -> Left {
    if (!HAS_SHEEN || max3(b.sheen) <= 0.0) {
        return no_layers_above();
    }
    let passes = sheen_passes(b.sheen, b.sheen_alpha, cosine);
    let arriving = vec3f(
        sheen_passes(b.sheen, b.sheen_alpha, RULE_COSINES.x), sheen_passes(b.sheen, b.sheen_alpha, RULE_COSINES.y),
        sheen_passes(b.sheen, b.sheen_alpha, RULE_COSINES.z));
    return Left(passes, dot(RULE_WEIGHTS, min(vec3f(passes), arriving)));
}

// Returns what all layers above the base leave; `w_o`: in the local frame.
fn left_for_base(b: Brdf, w_o: vec3f) -> Left {
    let coat = left_by_clearcoat(b, w_o);
    let sheen = left_by_sheen(b, w_o.z);
    return Left(coat.mirrored * sheen.mirrored, coat.scattered * sheen.scattered);
}

// Returns the share of light that sheen reflects, by colour, without a clear coat.
fn sheen_reflectance(b: Brdf, cosine: f32) -> vec3f {
    if (!HAS_SHEEN) {
        return vec3f(0.0);
    }
    return b.sheen * min(sheen_albedo(b.sheen_alpha, cosine), 1.0);
}
