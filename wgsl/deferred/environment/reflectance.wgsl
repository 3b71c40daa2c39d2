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
    // The lobe reflects R F, base and second scattering diffuse T + F_ms M. Stretched lobes count between their axes.
    let entry = load_ambient_albedo(cosine, b.alpha);
    let sine = sqrt(max(0.5 - 0.5 * cosine * cosine, 0.0));
    let shares = coat_shares(b, from_axes(b, vec3f(sine, sine, cosine)), entry.x);
    let lobe = fresnel_of(b, entry.y) * shares.lobe;
    let base = b.diffuse * shares.loss.transmitted + b.multiple * shares.loss.missing;
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
