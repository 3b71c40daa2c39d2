// A layered material and its sampling: clear coat over sheen over the base, each taking its light from what is below.
//
//   f = f_clearcoat + c(w_i, w_o) (f_sheen + s(w_i, w_o) f_base)
// `common/{clearcoat,sheen,base,transmission}.wgsl` have the lobes; c and s are min(share that passes from w_i, from w_o),
// so f is reciprocal and reflects at most 1. A surface that transmits has the same layers on both sides. Lobes that the
// scene lacks are compiled out. All directions are in the local frame, normal +Z, w_o above the surface.
#import "common/brdf_of.wgsl"
#import "common/transmission.wgsl"
#import "common/sampling.wgsl"

struct BrdfSample {
    w_i: vec3f,
    weight: vec3f,  // f_r |cos| / pdf
    pdf: f32,       // 1/sr; 0: the sample is invalid
}

// Returns the lobes that reflect light off the surface: neither the matte base nor what passes to the other side.
fn coat_of(b: Brdf) -> Brdf {
    var coat = b;
    coat.diffuse = vec3f(0.0);
    coat.transmitted = vec3f(0.0);
    return coat;
}

// Returns the GGX width of the narrowest lobe that reflects.
fn lobe_width(b: Brdf) -> f32 {
    let axes = lobe_axes(b, b.alpha);
    let base = min(axes.x, axes.y);
    return select(base, min(base, b.clearcoat.alpha), HAS_CLEARCOAT && b.clearcoat.share > 0.0);
}

// Returns about the share of light that the layers above the base let through one way, a mean over the hemisphere.
fn layers_pass(b: Brdf) -> f32 {
    var passes = 1.0;
    if (HAS_CLEARCOAT) {
        passes -= b.clearcoat.share * (1.0 - b.clearcoat.fit.mean_transmitted);
    }
    if (HAS_SHEEN) {
        passes *= 1.0 - max3(b.sheen) * mean_sheen_albedo(b.sheen_alpha);
    }
    return passes;
}

// The layers above the base.
struct Above {
    f: vec3f,     // their own lobes, 1/sr
    passes: f32,  // share that the base gets
}

fn layers_above(b: Brdf, w_o: vec3f, w_i: vec3f) -> Above {
    var above = Above(vec3f(0.0), 1.0);
    if (HAS_CLEARCOAT && b.clearcoat.share > 0.0) {
        if (w_i.z > 0.0) {
            above.f = vec3f(evaluate_clearcoat(b.clearcoat, w_o, w_i).x);
        }
        above.passes = min(clearcoat_passes(b.clearcoat, w_o), clearcoat_passes(b.clearcoat, w_i));
    }
    if (HAS_SHEEN && max3(b.sheen) > 0.0) {
        if (w_i.z > 0.0) {
            above.f += above.passes * evaluate_sheen(b.sheen, b.sheen_alpha, w_o, w_i);
        }
        above.passes *= min(
            sheen_passes(b.sheen, b.sheen_alpha, w_o.z), sheen_passes(b.sheen, b.sheen_alpha, abs(w_i.z)));
    }
    return above;
}

// Returns f, 1/sr; zero if w_o is below the surface, or w_i and nothing passes. `o`: the base's loss towards w_o.
fn scattered(b: Brdf, w_o: vec3f, o: CoatLoss, w_i: vec3f) -> vec3f {
    if (HAS_TRANSMISSION && w_i.z < 0.0 && w_o.z > 0.0 && max3(b.transmitted) > 0.0) {
        let above = layers_above(b, w_o, w_i);
        if (HAS_VOLUMES && b.eta > 0.0) {
            return above.passes * solid_passes(b, w_o, w_i).f;
        }
        return above.passes * thin_passes(b, w_o, w_i).f;
    }
    if (w_i.z <= 0.0 || w_o.z <= 0.0) {
        return vec3f(0.0);
    }
    if (!b.glossy) {
        return b.diffuse * INV_PI;
    }
    let f = base_reflects(b, w_o, o, w_i);
    if (HAS_CLEARCOAT || HAS_SHEEN) {
        let above = layers_above(b, w_o, w_i);
        return above.f + above.passes * f;
    }
    return f;
}

// Probabilities of the lobes beside the base's reflection, which is the rest.
struct LayerShares {
    clearcoat: f32,
    sheen: f32,
    thin: f32,  // transmission through a thin wall
}

// Returns shares in proportion to the lobes' reflectance; a clear coat gets at least a fifth.
fn layer_shares(b: Brdf, w_o: vec3f, o: CoatLoss) -> LayerShares {
    let passed = select(0.0, luminance(b.transmitted) * o.transmitted, HAS_TRANSMISSION && b.eta == 0.0);
    var base = luminance(fresnel_of(b, w_o.z)) * (1.0 - o.missing) + luminance(b.diffuse) * o.transmitted
        + luminance(b.multiple) * o.missing;
    if (HAS_VOLUMES && b.eta > 0.0) {
        base += luminance(b.transmitted) * unreflected(b, w_o.z) * (1.0 - o.missing);
    }
    var sheen = 0.0;
    var left = 1.0;
    if (HAS_SHEEN && max3(b.sheen) > 0.0) {
        sheen = luminance(b.sheen) * min(sheen_albedo(b.sheen_alpha, w_o.z), 1.0);
        left = sheen_passes(b.sheen, b.sheen_alpha, w_o.z);
    }
    let below = sheen + left * (base + passed);
    var shares = LayerShares(0.0, 0.0, 0.0);
    if (HAS_CLEARCOAT && b.clearcoat.share > 0.0 && dot(b.clearcoat.normal, w_o) > 0.0) {
        let passes = clearcoat_passes(b.clearcoat, w_o);
        shares.clearcoat = clamp((1.0 - passes) / max(1.0 - passes + passes * below, 1e-30), 0.2, 1.0);
    }
    let rest = (1.0 - shares.clearcoat) / max(below, 1e-30);
    shares.sheen = rest * sheen;
    shares.thin = rest * left * passed;
    return shares;
}

// Returns the density of sample_brdf's base in w_i above the surface.
fn base_pdf(b: Brdf, w_o: vec3f, o: CoatLoss, w_i: vec3f) -> f32 {
    let h = normalize(w_i + w_o);
    let shares = lobe_shares(b, w_o.z, o);
    var single = shares.single;
    if (HAS_VOLUMES && b.eta > 0.0) {
        single *= reflection_chance(b, dot(w_o, h));
    }
    return single * lobe_pdf(b, b.alpha, w_o, h) + shares.base * (w_i.z * INV_PI)
        + (1.0 - shares.single - shares.base) * multiple_pdf(b.alpha, w_i.z);
}

// Returns the density of sample_brdf in w_i, 1/sr.
fn brdf_pdf(b: Brdf, w_o: vec3f, o: CoatLoss, w_i: vec3f) -> f32 {
    var layers = LayerShares(0.0, 0.0, 0.0);
    if (HAS_CLEARCOAT || HAS_SHEEN || HAS_TRANSMISSION) {
        layers = layer_shares(b, w_o, o);
    }
    let rest = max(1.0 - layers.clearcoat - layers.sheen - layers.thin, 0.0);
    if (HAS_TRANSMISSION && w_i.z < 0.0) {
        if (HAS_VOLUMES && b.eta > 0.0) {
            return rest * lobe_shares(b, w_o.z, o).single * solid_passes(b, w_o, w_i).pdf;
        }
        return layers.thin * thin_passes(b, w_o, w_i).pdf;
    }
    var pdf = rest * base_pdf(b, w_o, o, w_i);
    if (HAS_CLEARCOAT && layers.clearcoat > 0.0) {
        pdf += layers.clearcoat * evaluate_clearcoat(b.clearcoat, w_o, w_i).y;
    }
    if (HAS_SHEEN) {
        pdf += layers.sheen * sheen_pdf(b.sheen_alpha, w_i.z);
    }
    return pdf;
}

// Returns (f, pdf of sample_brdf in w_i); zero where scattered() is.
fn evaluate_brdf(b: Brdf, w_o: vec3f, w_i: vec3f) -> vec4f {
    let passes = HAS_TRANSMISSION && w_i.z < 0.0 && max3(b.transmitted) > 0.0;
    if ((w_i.z <= 0.0 && !passes) || w_o.z <= 0.0) {
        return vec4f(0.0);
    }
    if (!b.glossy) {
        return vec4f(b.diffuse * INV_PI, w_i.z * INV_PI);
    }
    let o = coat_loss(b.fit, b.alpha, w_o.z);
    return vec4f(scattered(b, w_o, o, w_i), brdf_pdf(b, w_o, o, w_i));
}

// Returns a reflected direction; zero if it is below a surface where it would count as transmitted.
fn kept_above(b: Brdf, w_i: vec3f) -> vec3f {
    return select(w_i, vec3f(0.0), HAS_TRANSMISSION && w_i.z <= 0.0 && max3(b.transmitted) > 0.0);
}

// Draws a direction from the base's lobes, `choice` in [0, 1). Zero: lost.
fn sample_base(b: Brdf, w_o: vec3f, o: CoatLoss, u: vec2f, choice: f32) -> vec3f {
    let shares = lobe_shares(b, w_o.z, o);
    if (choice < shares.single) {
        let h = sample_lobe_normal(b, b.alpha, w_o, u);
        if (HAS_VOLUMES && b.eta > 0.0 && choice >= shares.single * reflection_chance(b, dot(w_o, h))) {
            let w_i = refracted(b.eta, w_o, h);
            return select(w_i, vec3f(0.0), w_i.z >= 0.0);
        }
        return kept_above(b, reflect(-w_o, h));
    }
    if (choice < shares.single + shares.base) {
        return sample_cosine_hemisphere(u);
    }
    return sample_multiple(b.alpha, u);
}

// Draws w_i with a density close to f |cos|; `choice` in [0, 1) picks the lobe.
fn sample_brdf(b: Brdf, w_o: vec3f, u: vec2f, choice: f32) -> BrdfSample {
    if (!b.glossy) {
        let w = sample_cosine_hemisphere(u);
        return BrdfSample(w, b.diffuse, w.z * INV_PI);
    }
    let o = coat_loss(b.fit, b.alpha, w_o.z);
    var w_i: vec3f;
    var left = choice;
    var layers = LayerShares(0.0, 0.0, 0.0);
    if (HAS_CLEARCOAT || HAS_SHEEN || HAS_TRANSMISSION) {
        layers = layer_shares(b, w_o, o);
    }
    let above = layers.clearcoat + layers.sheen;
    if (HAS_CLEARCOAT && choice < layers.clearcoat) {
        w_i = kept_above(b, sample_clearcoat(b.clearcoat, w_o, u));
    } else if (HAS_SHEEN && choice < above) {
        w_i = sample_sheen(b.sheen_alpha, u);
    } else if (HAS_TRANSMISSION && choice < above + layers.thin) {
        w_i = sample_thin(b, w_o, u, saturate((choice - above) / layers.thin));
        w_i = select(w_i, vec3f(0.0), w_i.z >= 0.0);
    } else {
        if (HAS_CLEARCOAT || HAS_SHEEN || HAS_TRANSMISSION) {
            left = (choice - above - layers.thin) / max(1.0 - above - layers.thin, 1e-30);
        }
        w_i = sample_base(b, w_o, o, u, left);
    }
    let f = evaluate_brdf(b, w_o, w_i);
    if (f.w <= 0.0) {
        return BrdfSample(w_i, vec3f(0.0), 0.0);
    }
    return BrdfSample(w_i, f.rgb * (abs(w_i.z) / f.w), f.w);
}
