// Directional-hemispherical reflectance, from the table of `albedo.wgsl`.
#import "common/brdf.wgsl"

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

// Returns the reflectance of what scatters widely, the base and the coat's second scattering: diffuse T + F_ms M.
fn wide_reflectance(b: Brdf, cosine: f32) -> vec3f {
    let loss = coat_loss(b.fit, b.alpha, cosine);
    return b.diffuse * loss.transmitted + b.multiple * loss.missing;
}

// Returns the directional-hemispherical reflectance: that of what scatters widely and the lobe's R F.
fn directional_reflectance(b: Brdf, cosine: f32) -> vec3f {
    if (!b.glossy) {
        return b.diffuse;
    }
    let entry = load_ambient_albedo(cosine, b.alpha);
    return wide_reflectance(b, cosine) + fresnel_schlick(b.f0, entry.y) * entry.x;
}
