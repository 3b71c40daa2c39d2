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

// What the layers above the base leave of light: what a mirror below them reflects, on both ways, and what a surface gets
// that is lit from all directions. `common/brdf.wgsl` takes the lesser of both ways' shares; the mean over the hemisphere
// is here that of the lesser of one way and the mean, which errs bright by at most 2 %.
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
    let mean = 1.0 - b.clearcoat.share * (1.0 - b.clearcoat.fit.mean_transmitted);
    return Left(passes, min(passes, mean));
}

// Returns what sheen leaves.
fn left_by_sheen(b: Brdf, cosine: f32) -> Left {
    if (!HAS_SHEEN || max3(b.sheen) <= 0.0) {
        return no_layers_above();
    }
    let passes = sheen_passes(b.sheen, b.sheen_alpha, cosine);
    let mean = 1.0 - max3(b.sheen) * mean_sheen_albedo(b.sheen_alpha);
    return Left(passes, min(passes, mean));
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
