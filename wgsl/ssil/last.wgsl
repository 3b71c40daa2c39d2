// One invocation brings irradiance to a pixel of the picture, and with REFLECTED turns it into indirect = rho / pi E,
// W/(m2 sr). In: G-buffer; surfels and irradiance of the level that the gathering starts at, irradiance of lone pixels.
#import "shared/gbuffer/load.wgsl"
#import "common/coat.wgsl"
#import "ssil/upsample.wgsl"

override SQUARE: u32 = 2u;
override UPSAMPLED: bool = false;  // the irradiance is that of the picture's pixels already
override REFLECTED: bool = true;

@group(1) @binding(13) var surfels: texture_storage_2d<rgba32uint, read>;
@group(1) @binding(14) var<storage, read_write> full: array<vec4f>;

// Pixels that no pixel of the first level stands for: these have an irradiance of their own.
@group(1) @binding(15) var<storage, read> lone: array<u32>;                // by their index
@group(1) @binding(16) var<storage, read> lone_groups: array<u32>;         // x, y, z workgroups; pixels
@group(1) @binding(18) var<storage, read> lone_irradiance: array<vec4f>;

const LONE_GROUP: u32 = 64u;

// Returns what a pixel gets, or reflects.
fn lit(pixel: vec2u, surface: GbufferSurface, found: Upsampled) -> vec4f {
    var light = found.irradiance;
    if (REFLECTED) {
        let brdf = gbuffer_brdf(surface);
        light *= brdf.diffuse * INV_PI;
        if (HAS_COATS) {
            // What the coat lets through: Schlick's term in the mean over the hemisphere, by the cosine, is 1 / 21.
            light *= select(vec3f(1.0), (1.0 - brdf.f0) * (20.0 / 21.0), brdf.glossy);
            let tint = coat_tint(brdf, surface.normal, -pixel_ray(pixel).direction);
            light += select(vec3f(0.0), found.glossy * tint, brdf.glossy);
        }
    }
    return vec4f(light, 1.0);
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (any(id.xy >= view.size)) {
        return;
    }
    let index = id.y * view.size.x + id.x;
    let texel = textureLoad(surfels, id.xy);
    let surface = load_surface(id.xy);
    if (is_empty(texel) || (surface.flags & GBUFFER_UNLIT) != 0u) {
        full[index] = vec4f(0.0);
        return;
    }
    var found = Upsampled(vec3f(0.0), vec3f(0.0));
    if (SQUARE > 1u && !(UPSAMPLED && !HAS_GLOSSY)) {
        found = upsample(id.xy, texel, f32(SQUARE));
    } else if (HAS_GLOSSY) {
        found.glossy = coarse_glossy[index].rgb;
    }
    if (UPSAMPLED || SQUARE == 1u) {
        found.irradiance = coarse[index].rgb;
    }
    full[index] = lit(id.xy, surface, found);
}

@compute @workgroup_size(LONE_GROUP)
fn listed(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    for (var slot = id.x; slot < lone_groups[3]; slot += groups.x * LONE_GROUP) {
        let index = lone[slot];
        let pixel = vec2u(index % view.size.x, index / view.size.x);
        let surface = load_surface(pixel);
        if ((surface.flags & GBUFFER_UNLIT) == 0u) {
            var found = upsample(pixel, textureLoad(surfels, pixel), f32(SQUARE));
            found.irradiance = lone_irradiance[slot].rgb;
            full[index] = lit(pixel, surface, found);
        }
    }
}
