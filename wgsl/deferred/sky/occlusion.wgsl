// One invocation estimates the environment's irradiance at a pixel's surface with few rays, with and without occlusion.
// Their ratio is the unoccluded share.
//
// Candidate directions are sampled by the cosine and, under a map, also by the map (balance heuristic, Veach and Guibas
// 1995). Each ray takes one candidate in proportion to its light (importance resampling, Talbot et al. 2005): E = W / K
// sum_k f_k V_k / w_k, f = L cos / density, w = luminance(f), W the mean of w over the candidates. The pixels of an n x
// n square share a stratified set of directions and rotate through it from frame to frame; the following blur averages
// both estimates over such squares before it divides. In: G-buffer, scene. Out: irradiance with occlusion, W/m2 (of a
// constant environment the share itself), and the depth of `shared/denoise/plane.wgsl`, 0 where there is nothing to
// light; irradiance without occlusion; normals. No noise where nothing or everything is occluded. The ratio of means of
// few samples is consistent, biased either way by O(1 / rays).
#import "scene/sequence.wgsl"
#import "scene/lights.wgsl"
#import "scene/trace.wgsl"
#import "shared/gbuffer/visible_surface.wgsl"
#import "shared/gbuffer/read.wgsl"
#import "shared/gbuffer/tiles.wgsl"
#import "shared/denoise/plane.wgsl"
#import "common/interleave.wgsl"

@group(1) @binding(11) var<storage, read_write> arriving: array<vec4f>;
@group(1) @binding(12) var<storage, read_write> normals: array<u32>;
@group(1) @binding(13) var<storage, read_write> sent: array<vec4f>;
@group(1) @binding(19) var<uniform> params: Params;

struct Params {
    seed: u32,
    rays: u32,  // per pixel
}

const CHOICE_PAIR: u32 = 0u;
const COSINE_PAIR: u32 = 1u;
const MAP_PAIR: u32 = 2u;
// Candidates per ray from each density: the cosine and the map. tools/README.md, "Constants".
const CANDIDATES: u32 = 2u;

struct SkySample {
    direction: vec3f,
    light: vec3f,      // f W / w
}

// Returns f of a direction, given its density by the map.
fn incident(normal: vec3f, direction: vec3f, by_map: f32) -> vec3f {
    let cosine = max(dot(normal, direction), 0.0);
    let density = 0.5 * (cosine * INV_PI + by_map);
    return environment_radiance(direction) * (cosine / max(density, 1e-20));
}

// Returns one of the candidates, resampled by its light; `number`: of the ray in its sequence.
fn resample(normal: vec3f, number: u32) -> SkySample {
    let frame = frame_from_normal(normal);
    if (!HAS_PICTURED_ENVIRONMENT) {
        let u = sobol_2d(number, hash2(COSINE_PAIR, params.seed));
        return SkySample(frame * sample_cosine_hemisphere(u), vec3f(1.0));
    }
    // Replace the kept candidate with the probability of the new one's share in the sum so far (reservoir sampling).
    var kept = SkySample(normal, vec3f(0.0));
    var kept_weight = 0.0;
    var sum = 0.0;
    var choice = sobol_2d(number, hash2(CHOICE_PAIR, params.seed)).x;
    for (var k = 0u; k < 2u * CANDIDATES; k += 1u) {
        var direction: vec3f;
        var by_map: f32;
        if (k < CANDIDATES) {
            let u = sobol_2d(number * CANDIDATES + k, hash2(COSINE_PAIR, params.seed));
            direction = frame * sample_cosine_hemisphere(u);
            by_map = environment_pdf(direction) / max(scene.environment_pdf, 1e-9);
        } else {
            let u = sobol_2d(number * CANDIDATES + k - CANDIDATES, hash2(MAP_PAIR, params.seed));
            let sampled = sample_environment(u);
            direction = sampled.xyz;
            by_map = sampled.w;
        }
        let light = incident(normal, direction, by_map);
        let weight = luminance(light);
        sum += weight;
        let share = weight / max(sum, 1e-37);
        let takes = choice < share;
        choice = select((choice - share) / max(1.0 - share, 1e-7), choice / max(share, 1e-37), takes);
        if (takes) {
            kept = SkySample(direction, light);
            kept_weight = weight;
        }
    }
    kept.light *= sum / (f32(2u * CANDIDATES) * max(kept_weight, 1e-37));
    return kept;
}

@compute @workgroup_size(8, 8)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) thread: vec3u) {
    let pixel = pixel_of_tile(group, thread, view.size);
    if (any(pixel >= view.size)) {
        return;
    }
    let index = pixel.y * view.size.x + pixel.x;
    let seen = load_visibility(pixel);
    let surface = load_surface(pixel);
    if (seen.x == NONE || (surface.flags & GBUFFER_UNLIT) != 0u) {
        return;
    }
    let ray = pixel_ray(pixel);
    let distance_seen = load_distance(pixel);
    let position = ray.origin + ray.direction * distance_seen;
    let front = dot(surface.geometric_normal, ray.direction) < 0.0;
    let side = select(-surface.geometric_normal, surface.geometric_normal, front);
    let start = position + side * pixel_ray_offset(distance_seen);
    // Always `params.rays`, written so that it varies: lavapipe compiles loops up to a uniform anew for each dispatch.
    let rays = select(0u, params.rays, distance_seen > 0.0);
    let first = (sequence.index * class_count() + class_of(pixel, sequence.index)) * rays;
    var visible = vec3f(0.0);
    var unoccluded = vec3f(0.0);
    for (var k = 0u; k < rays; k += 1u) {
        let picked = resample(surface.normal, first + k);
        unoccluded += picked.light;
        // The surface occludes directions below it.
        if (dot(picked.direction, side) > 0.0 && max3(picked.light) > 0.0) {
            let way = Ray(start, picked.direction);
            let found = trace_shadow(way, FLOAT_MAX);
            visible += select(picked.light, vec3f(0.0), found.occluded_a);
        }
    }
    arriving[index] = vec4f(visible / f32(rays), plane_depth(ray, distance_seen));
    if (HAS_PICTURED_ENVIRONMENT) {
        sent[index] = vec4f(unoccluded / f32(rays), 1.0);
    }
    normals[index] = pack_view_normal(surface.normal);
}
