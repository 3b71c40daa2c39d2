// The environment's light reflected by a surface, unoccluded.
//
// L_o = integral f_r L cos dw over the hemisphere of the normal. Under a constant environment the result is exact but
// for the table's interpolation, the fits, and the means of what layers leave each other (`common/lobes.wgsl`; they err
// bright by up to 3 %). Under a picture the base and the coat's second scattering add (diffuse T + F_ms M) E / pi, as
// if all directions sent alike, and the lobe the split sum R F mean(L) of Karis 2013. Departure: mean(L) is looked up
// around the lobe's mean direction, since grazing and rough lobes lean away from the mirror direction. A clear coat
// adds a lobe about its own normal, sheen its albedo times E / pi; a stretched lobe is the mean of narrower ones along
// its axis. Errs at glancing angles, where lobes are longer than wide, and includes light from below the surface's
// horizon. Without the occlusion of `deferred/sky` or `ssdo` it errs bright.
#import "scene/environment.wgsl"
#import "deferred/environment/maps.wgsl"
#import "deferred/environment/reflectance.wgsl"

@group(1) @binding(21) var ambient_maps: texture_2d<f32>;    // of `prefilter.wgsl`

// Rotates a direction of the world into the map's frame.
fn picture_from_world(direction: vec3f) -> vec3f {
    let turn = TWO_PI * scene.environment_rotation;
    let c = cos(turn);
    let s = sin(turn);
    return vec3f(c * direction.x - s * direction.z, direction.y, s * direction.x + c * direction.z);
}

// Returns the value of prefiltered map k around a unit direction in the picture's frame, bilinear.
fn load_ambient_map(k: u32, direction: vec3f) -> vec3f {
    let side = map_side(k);
    let point = (0.5 * octahedral_encode(direction) + 0.5) * f32(side) - 0.5;
    let base = vec2i(floor(point));
    let f = point - vec2f(base);
    let corner = vec2i(0, i32(map_row(k)));
    let t00 = textureLoad(ambient_maps, corner + fold_texel(base, i32(side)), 0);
    let t10 = textureLoad(ambient_maps, corner + fold_texel(base + vec2i(1, 0), i32(side)), 0);
    let t01 = textureLoad(ambient_maps, corner + fold_texel(base + vec2i(0, 1), i32(side)), 0);
    let t11 = textureLoad(ambient_maps, corner + fold_texel(base + vec2i(1, 1), i32(side)), 0);
    return mix(mix(t00, t10, f.x), mix(t01, t11, f.x), f.y).rgb;
}

// Returns the mean radiance under a lobe of width `alpha` around a unit direction, W/(m2 sr).
fn ambient_lobe(direction: vec3f, alpha: f32) -> vec3f {
    if (!HAS_PICTURED_ENVIRONMENT) {
        return scene.environment_color;
    }
    let turned = picture_from_world(direction);
    let place = -log2(alpha);
    let k = u32(clamp(place, 0.0, f32(LAST_MAP)));
    let blurred = scene.environment_color * load_ambient_map(k, turned);
    if (k == LAST_MAP) {
        // Interpolate between the sharpest map and the picture itself.
        let narrowest = exp2(-f32(LAST_MAP));
        let share = saturate((alpha - MIN_ALPHA) / (narrowest - MIN_ALPHA));
        return mix(environment_radiance(direction), blurred, share);
    }
    let sharper = scene.environment_color * load_ambient_map(k + 1u, turned);
    return mix(blurred, sharper, saturate(place - f32(k)));
}

// Returns the irradiance of the hemisphere around a unit normal, W/m2.
fn ambient_irradiance(normal: vec3f) -> vec3f {
    if (!HAS_ENVIRONMENT) {
        return vec3f(0.0);
    }
    if (!HAS_PICTURED_ENVIRONMENT) {
        return PI * scene.environment_color;
    }
    return PI * scene.environment_color * load_ambient_map(0u, picture_from_world(normal));
}

// The environment's light reflected to the eye, W/(m2 sr).
struct Ambient {
    base: vec3f,
    coat: vec3f,  // the lobe, and what the coat scatters more than once
}

// Returns the environment's mean radiance under a GGX lobe; `entry`: of the table; `normal` and `w_o` are unit, of the
// world.
fn lobe_light(normal: vec3f, w_o: vec3f, cos_o: f32, entry: vec3f, alpha: f32) -> vec3f {
    // The lobe's mean direction along the surface, away from the viewer.
    let across = entry.z * (normal * cos_o - w_o);
    let lobe = across + normal * sqrt(max(1.0 - dot(across, across), 0.0));
    return ambient_lobe(normalize(lobe), alpha);
}

// Parts of a stretched lobe.
const STRETCHED_PARTS: u32 = 5u;

// Returns the same under a stretched lobe: of lobes as wide as it is across, about normals at equal steps of the
// distribution of slopes along it, x = a s / sqrt(1 - s^2).
fn stretched_light(b: Brdf, normal: vec3f, w_o: vec3f) -> vec3f {
    let tangent = frame_from_normal(normal) * vec3f(b.tangent, 0.0);
    var sum = vec4f(0.0);
    for (var k = 0u; k < STRETCHED_PARTS; k += 1u) {
        let s = (2.0 * f32(k) + 1.0) / f32(STRETCHED_PARTS) - 1.0;
        let h = normalize(normal + tangent * (b.alpha * b.stretch * s * inverseSqrt(1.0 - s * s)));
        let direction = reflect(-w_o, h);
        let cosine = max(dot(direction, normal), 1e-4);
        sum += cosine * vec4f(ambient_lobe(direction, max(b.alpha / b.stretch, MIN_ALPHA)), 1.0);
    }
    return sum.rgb / sum.a;
}

// Returns the light that a clear coat reflects.
fn clearcoat_light(c: Clearcoat, normal: vec3f, w_o: vec3f) -> vec3f {
    let n = frame_from_normal(normal) * c.normal;
    let cos_o = clamp(dot(n, w_o), 0.0, 1.0);
    let entry = load_ambient_albedo(cos_o, c.alpha);
    let share = c.share * fresnel_schlick(vec3f(DIELECTRIC_F0), entry.y).x * entry.x;
    return share * lobe_light(n, w_o, cos_o, entry, c.alpha);
}

// Returns the light reflected to w_o by base and coat; `normal` and `w_o` are unit, of the world.
fn ambient_parts(brdf: Brdf, normal: vec3f, w_o: vec3f) -> Ambient {
    if (!HAS_ENVIRONMENT) {
        return Ambient(vec3f(0.0), vec3f(0.0));
    }
    let mean = INV_PI * ambient_irradiance(normal);
    if (!brdf.glossy) {
        return Ambient(brdf.diffuse * mean, vec3f(0.0));
    }
    let cos_o = clamp(dot(normal, w_o), 0.0, 1.0);
    let entry = load_ambient_albedo(cos_o, brdf.alpha);
    let local = vec3f((w_o * frame_from_normal(normal)).xy, cos_o);
    let shares = coat_shares(brdf, local, entry.x);
    var light: vec3f;
    if (HAS_ANISOTROPY && brdf.stretch > 1.0) {
        light = stretched_light(brdf, normal, w_o);
    } else {
        light = lobe_light(normal, w_o, cos_o, entry, brdf.alpha);
    }
    let base = brdf.diffuse * shares.loss.transmitted * mean;
    let once = fresnel_of(brdf, entry.y) * shares.lobe * light;
    let again = brdf.multiple * shares.loss.missing * mean;
    if (!HAS_CLEARCOAT && !HAS_SHEEN) {
        return Ambient(base, once + again);
    }
    // Put sheen, then the clear coat above.
    let sheen = left_by_sheen(brdf, cos_o);
    let coat = left_by_clearcoat(brdf, local);
    let below = sheen_reflectance(brdf, cos_o) * mean + sheen.scattered * again;
    var parts = Ambient(
        coat.scattered * sheen.scattered * base, coat.scattered * below + coat.mirrored * sheen.mirrored * once);
    if (HAS_CLEARCOAT && brdf.clearcoat.share > 0.0) {
        parts.coat += clearcoat_light(brdf.clearcoat, normal, w_o);
    }
    return parts;
}

// Returns the radiance reflected to w_o, W/(m2 sr).
fn ambient_radiance(brdf: Brdf, normal: vec3f, w_o: vec3f) -> vec3f {
    let parts = ambient_parts(brdf, normal, w_o);
    return parts.base + parts.coat;
}
