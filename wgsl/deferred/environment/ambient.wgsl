// The environment's light reflected by a surface, unoccluded.
//
// L_o = integral f_r L cos dw over the hemisphere of the normal. Under a constant environment the result is exact but
// for the table's interpolation and the fits. Under a picture the base and the coat's second scattering add (diffuse T +
// F_ms M) E / pi, as if all directions sent alike, and the lobe the split sum R F mean(L) of Karis 2013. Departure: mean(L) is looked up
// around the lobe's mean direction, since grazing and rough lobes lean away from the mirror direction. Errs at glancing
// angles, where lobes are longer than wide, and includes light from below the surface's horizon. Without the occlusion
// of `deferred/sky` or `ssdo` it errs bright.
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
    let fresnel = fresnel_schlick(brdf.f0, entry.y);
    // The lobe's mean direction along the surface, away from the viewer.
    let across = entry.z * (normal * cos_o - w_o);
    let lobe = across + normal * sqrt(max(1.0 - dot(across, across), 0.0));
    let loss = coat_loss(brdf.fit, brdf.alpha, cos_o);
    let once = fresnel * entry.x * ambient_lobe(normalize(lobe), brdf.alpha);
    return Ambient(brdf.diffuse * loss.transmitted * mean, once + brdf.multiple * loss.missing * mean);
}

// Returns the radiance reflected to w_o, W/(m2 sr).
fn ambient_radiance(brdf: Brdf, normal: vec3f, w_o: vec3f) -> vec3f {
    let parts = ambient_parts(brdf, normal, w_o);
    return parts.base + parts.coat;
}
