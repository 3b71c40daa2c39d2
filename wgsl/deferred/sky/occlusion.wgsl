// One invocation finds how much of the environment's light reaches a pixel's surface, by few rays: what it gets, and what
// it would get if nothing stood between, whose ratio is the share that arrives.
//
// Directions are drawn by the cosine, under a picture also by the picture (balance heuristic, Veach and Guibas 1995),
// and of those one for each ray by the light that it would bring (importance resampling, Talbot et al. 2005):
// E = W / K sum_k f_k V_k / w_k, W the mean of w = luminance(f) over the directions drawn, f = L cos / density.
// Pixels of an n x n square share a stratified set of directions among them, each pixel another part of it from frame
// to frame; the blur that follows averages both over such squares before it divides. In: G-buffer, scene. Out: light, W/m2, 1 for what a constant environment gives, the
// depth of `shared/denoise/plane.wgsl`, 0 where there is nothing to light; and the same without occluders. A ratio, so free of
// noise where nothing or all is hidden; errs by what a ratio of small sums does.
#import "scene/sequence.wgsl"
#import "scene/lights.wgsl"
#import "scene/trace.wgsl"
#import "shared/gbuffer/seen.wgsl"
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
    rays: u32,  // for each pixel
}

const CHOICE_PAIR: u32 = 0u;
const COSINE_PAIR: u32 = 1u;
const PICTURE_PAIR: u32 = 2u;
// Directions drawn for each ray, by the cosine and by the picture. Chosen.
const DRAWN: u32 = 2u;

struct Chosen {
    direction: vec3f,
    light: vec3f,      // f W / w
}

// Returns f of a direction whose density by the picture is known.
fn incident(normal: vec3f, direction: vec3f, by_picture: f32) -> vec3f {
    let cosine = max(dot(normal, direction), 0.0);
    let density = 0.5 * (cosine * INV_PI + by_picture);
    return environment_radiance(direction) * (cosine / max(density, 1e-20));
}

fn choose(normal: vec3f, number: u32) -> Chosen {
    let frame = frame_from_normal(normal);
    if (!HAS_PICTURED_ENVIRONMENT) {
        let u = sobol_2d(number, hash2(COSINE_PAIR, params.seed));
        return Chosen(frame * sample_cosine_hemisphere(u), vec3f(1.0));
    }
    // Keep each one with the chance of its share in the sum so far.
    var kept = Chosen(normal, vec3f(0.0));
    var kept_weight = 0.0;
    var sum = 0.0;
    var choice = sobol_2d(number, hash2(CHOICE_PAIR, params.seed)).x;
    for (var k = 0u; k < 2u * DRAWN; k += 1u) {
        var direction: vec3f;
        var by_picture: f32;
        if (k < DRAWN) {
            let u = sobol_2d(number * DRAWN + k, hash2(COSINE_PAIR, params.seed));
            direction = frame * sample_cosine_hemisphere(u);
            by_picture = environment_pdf(direction) / max(scene.environment_pdf, 1e-9);
        } else {
            let drawn = sample_environment(sobol_2d(number * DRAWN + k - DRAWN, hash2(PICTURE_PAIR, params.seed)));
            direction = drawn.xyz;
            by_picture = drawn.w;
        }
        let light = incident(normal, direction, by_picture);
        let weight = luminance(light);
        sum += weight;
        let share = weight / max(sum, 1e-37);
        let takes = choice < share;
        choice = select((choice - share) / max(1.0 - share, 1e-7), choice / max(share, 1e-37), takes);
        if (takes) {
            kept = Chosen(direction, light);
            kept_weight = weight;
        }
    }
    kept.light *= sum / (f32(2u * DRAWN) * max(kept_weight, 1e-37));
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
    let first = (sequence.index * class_count() + class_of(pixel, sequence.index)) * params.rays;
    var visible = vec3f(0.0);
    var whole = vec3f(0.0);
    for (var k = 0u; k < params.rays; k += 1u) {
        let chosen = choose(surface.normal, first + k);
        whole += chosen.light;
        // Below the surface itself there is nothing to see.
        if (dot(chosen.direction, side) > 0.0 && max3(chosen.light) > 0.0) {
            let way = Ray(start, chosen.direction);
            let found = trace_shadow(way, FLOAT_MAX);
            visible += select(chosen.light, vec3f(0.0), found.occluded_a);
        }
    }
    arriving[index] = vec4f(visible / f32(params.rays), plane_depth(ray, distance_seen));
    if (HAS_PICTURED_ENVIRONMENT) {
        sent[index] = vec4f(whole / f32(params.rays), 1.0);
    }
    normals[index] = pack_view_normal(surface.normal);
}
