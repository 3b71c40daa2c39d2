// Directional-hemispherical reflectance, from the table of `albedo.wgsl`.
#import "common/lobes.wgsl"

@group(1) @binding(20) var ambient_albedo: texture_2d<f32>;

// Returns the table's entry (R, mean Fresnel cosine, lean), bilinear.
fn load_ambient_albedo(cos_o: f32, alpha: f32) -> vec3f {
    let last = vec2i(textureDimensions(ambient_albedo)) - 1;
    let lowest = sqrt(sqrt(MIN_ALPHA));
    let at = saturate(vec2f(pow(max(cos_o, 1e-20), 1.0 / 3.0), (sqrt(sqrt(alpha)) - lowest) / (1.0 - lowest)));
    let point = at * vec2f(last);
    let base = min(vec2i(point), last - 1);
    let f = point - vec2f(base);
    let t00 = textureLoad(ambient_albedo, base, 0);
    let t10 = textureLoad(ambient_albedo, base + vec2i(1, 0), 0);
    let t01 = textureLoad(ambient_albedo, base + vec2i(0, 1), 0);
    let t11 = textureLoad(ambient_albedo, base + vec2i(1, 1), 0);
    return mix(mix(t00, t10, f.x), mix(t01, t11, f.x), f.y).xyz;
}

// Returns the reflectance of a coat's lobe, R F, from the table's entry.
fn lobe_reflectance(b: Brdf, entry: vec3f) -> vec3f {
    return fresnel_of(b, entry.y) * entry.x;
}

// Returns the reflectance of what scatters widely below all layers, the base and the coat's second scattering:
// diffuse T + F_ms M.
fn base_reflectance(b: Brdf, cosine: f32) -> vec3f {
    let loss = coat_loss(b.fit, b.alpha, cosine);
    return b.diffuse * loss.transmitted + b.multiple * loss.missing;
}

// Reflectances of a layered surface: of the base's lobe, of the clear coat's, and of all else.
struct Reflectances {
    lobe: vec3f,
    clearcoat: f32,
    wide: vec3f,
}

fn reflectances_of(b: Brdf, cosine: f32) -> Reflectances {
    if (!b.glossy) {
        return Reflectances(vec3f(0.0), 0.0, b.diffuse);
    }
    let lobe = lobe_reflectance(b, load_ambient_albedo(cosine, b.alpha));
    let base = base_reflectance(b, cosine);
    if (!HAS_CLEARCOAT && !HAS_SHEEN) {
        return Reflectances(lobe, 0.0, base);
    }
    // The clear coat counts as if its normal were the surface's.
    var coated = b;
    coated.clearcoat.normal = vec3f(0.0, 0.0, 1.0);
    let coat = left_by_clearcoat(coated, vec3f(sqrt(max(1.0 - cosine * cosine, 0.0)), 0.0, cosine));
    let sheen = left_by_sheen(b, cosine);
    let wide = coat.scattered * (sheen_reflectance(b, cosine) + sheen.scattered * base);
    return Reflectances(lobe * (coat.mirrored * sheen.mirrored), 1.0 - coat.mirrored, wide);
}

// Returns the directional-hemispherical reflectance.
fn directional_reflectance(b: Brdf, cosine: f32) -> vec3f {
    let r = reflectances_of(b, cosine);
    return r.lobe + r.clearcoat + r.wide;
}
