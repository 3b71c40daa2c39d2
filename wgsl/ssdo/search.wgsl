// One invocation computes the share of the environment's light that reaches a receiver, per channel, and its occluders:
// V = pi / (N E) sum_k L(w_k) V(w_k), with E the unoccluded irradiance (Ritschel et al. 2009, section 3: the sum
// of L_in V cos dw over N directions).
//
// Directions are drawn by the cosine. The pixels of an n x n square share one stratified set of directions, and the
// following blur averages over such squares. L is the environment filtered to about the solid angle of one direction of
// a set, so a small sun casts a soft shadow. With SAMPLE_ENVIRONMENT every other direction is drawn by importance
// sampling of the environment (balance heuristic, Veach and Guibas 1995), L is unfiltered, and the blur divides the
// sums with and without V. A coated pixel also finds the hits of LOBES directions drawn from its coat; V stays that of
// the others. In: G-buffer, depths of all sources, the prefiltered environment. Out: V, whose mean is 1 without
// occluders, and the depth of `shared/denoise/plane.wgsl`, 0 where there is nothing to light; the surface that each
// direction hits. Errs bright where the occluder is in no view, dark behind occluders thinner than assumed.
#import "scene/sequence.wgsl"
#import "shared/gbuffer/load.wgsl"
#import "shared/gbuffer/tiles.wgsl"
#import "deferred/environment/ambient.wgsl"
#import "scene/environment_sampling.wgsl"
#import "common/random.wgsl"
#import "shared/denoise/plane.wgsl"
#import "ssdo/march.wgsl"
#import "ssdo/lobe.wgsl"
#import "ssdo/grid.wgsl"
#import "shared/upsample/unrepresented.wgsl"

override DIRECTIONS: u32 = 1u;             // N
override LOBES: u32 = 0u;                  // further directions of coated pixels, drawn from the coat
override INTERLEAVE: u32 = 4u;             // n
override DIRECTIONAL: bool = true;         // false: V is the mean of V(w_k), ambient occlusion
override OUTWARD: bool = false;            // light the counter-clockwise side of surfaces, not the visible side
override SAMPLE_ENVIRONMENT: bool = false;
override HITS: bool = true;                // store the surfaces
override UNREPRESENTED: bool = false;      // process unrepresented pixels only
override STORE_SHARE: bool = true;         // store V of unrepresented pixels

@group(1) @binding(11) var<storage, read_write> occlusion: array<vec4f>;
@group(1) @binding(12) var<storage, read_write> normals: array<u32>;
@group(1) @binding(13) var<storage, read_write> hits: array<vec2u>;         // packed by `ssdo/hit_code.wgsl`
@group(1) @binding(14) var<storage, read_write> unoccluded: array<vec4f>;   // with SAMPLE_ENVIRONMENT: sum without V
@group(1) @binding(19) var<uniform> params: Params;

struct Params {
    seed: u32,
    lobe: u32,        // number of the environment's prefiltered map that is L
    radius: f32,      // largest r_max, in heights of the picture at the receiver
}

// 2^32 over the golden ratio: its multiples spread evenly (Weyl).
const GOLDEN: u32 = 2654435769u;

struct Sample {
    direction: vec3f,
    weight: f32,       // cosine / (pi pdf)
}

fn sample_direction(frame: mat3x3f, number: u32) -> Sample {
    if (!SAMPLE_ENVIRONMENT) {
        return Sample(frame * sample_cosine_hemisphere(sobol_2d(number, params.seed)), 1.0);
    }
    let u = sobol_2d(number / 2u, hash2(number & 1u, params.seed));
    var direction = frame * sample_cosine_hemisphere(u);
    if ((number & 1u) != 0u) {
        direction = sample_environment(u).xyz;
    }
    let cosine_pdf = max(dot(frame[2], direction), 0.0) * INV_PI;
    let picture_pdf = environment_pdf(direction) / max(scene.environment_pdf, 1e-9);
    return Sample(direction, 2.0 * cosine_pdf / max(cosine_pdf + picture_pdf, 1e-30));
}

// Returns L of a direction, divided by its mean over the hemisphere unless SAMPLE_ENVIRONMENT.
fn radiance_from(direction: vec3f, mean: vec3f) -> vec3f {
    if (SAMPLE_ENVIRONMENT) {
        return environment_radiance(direction);
    }
    if (!HAS_ENVIRONMENT || !HAS_PICTURED_ENVIRONMENT || !DIRECTIONAL) {
        return vec3f(1.0);
    }
    return load_ambient_map(params.lobe, picture_from_world(direction)) / mean;
}

// Finds the hits of a pixel's directions. `slot`: index of the results; `pattern`: number of the pixel's part of its
// square's directions.
fn find_occlusion(pixel: vec2u, slot: u32, pattern: u32) {
    // The receiver: its position, its side and its frame of directions.
    let seen = load_distance(pixel);
    let surface = load_surface(pixel);
    if (seen <= 0.0 || (surface.flags & GBUFFER_UNLIT) != 0u) {
        return;
    }
    let ray = pixel_ray(pixel);
    let position = ray.origin + ray.direction * seen;
    let faces = dot(surface.geometric_normal, ray.direction) < 0.0;
    let side = select(-surface.geometric_normal, surface.geometric_normal, faces || OUTWARD);
    let normal = select(surface.normal, -surface.normal, OUTWARD && !faces);
    let frame = frame_from_normal(normal);
    let radius = search_radius(ray, seen, params.radius);
    let brdf = gbuffer_brdf(surface);
    let m = marcher(position, frame, frame_from_normal(side), radius);
    // A pixel's part changes from frame to frame, so the mean of a single pixel converges, too.
    let patterns = INTERLEAVE * INTERLEAVE;
    let part = sequence.index * patterns + (pattern + sequence.index * 5u) % patterns;
    let first = part * DIRECTIONS;
    let first_lobe = part * LOBES;
    var mean = vec3f(1.0);
    if (HAS_ENVIRONMENT && HAS_PICTURED_ENVIRONMENT && DIRECTIONAL && !SAMPLE_ENVIRONMENT) {
        mean = max(load_ambient_map(0u, picture_from_world(normal)), vec3f(1e-30));
    }
    var arriving = vec3f(0.0);
    var emitted = vec3f(0.0);
    for (var k = 0u; k < DIRECTIONS + LOBES; k += 1u) {
        let is_lobe = LOBES > 0u && k >= DIRECTIONS;
        if (is_lobe && !brdf.glossy) {
            break;
        }
        // March along a direction; directions below the surface see nothing.
        var number = first + k;
        var sample = Sample(vec3f(0.0), 0.0);
        if (is_lobe) {
            number = first_lobe + k - DIRECTIONS;
            sample = Sample(sample_lobe(brdf, frame, -ray.direction, number, params.seed), 1.0);
        } else {
            sample = sample_direction(frame, number);
        }
        let direction = sample.direction;
        var hit = march(m, direction * frame, unit_float(number * GOLDEN));
        let is_below = dot(direction, side) <= 0.0;
        hit = select(hit, NO_HIT, is_below);
        var visible = select(1.0, 0.0, is_below);
        // Weight the hit.
        var hit_direction = 0u;
        if (hit != NO_HIT) {
            let to_hit = hit_position(hit) - position;
            let weight = hit_weight(hit, to_hit, radius);
            visible = 1.0 - weight;
            if (HITS) {
                // Sample weights go up to 2, stored weights up to 1.
                let factor = select(1.0, 0.5 * sample.weight, SAMPLE_ENVIRONMENT && !is_lobe);
                let along = to_hit * inverseSqrt(max(dot(to_hit, to_hit), 1e-30));
                let sine = dot(normal, along);
                hit_direction = pack_hit_direction(
                    HitDirection(along, select(0.0, weight * factor, sine > 0.0), sine > LEAST_SINE));
            }
        }
        if (!is_lobe) {
            let light = radiance_from(direction, mean) * sample.weight;
            arriving += light * visible;
            emitted += light;
        }
        if (HITS) {
            hits[slot * (DIRECTIONS + LOBES) + k] = vec2u(hit, hit_direction);
        }
    }
    // Store V, or both sums for the blur to divide.
    let count = f32(max(DIRECTIONS, 1u));
    let depth = plane_depth(ray, seen);
    if (UNREPRESENTED) {
        let share = select(arriving / count, arriving / max(emitted, vec3f(1e-30)), SAMPLE_ENVIRONMENT);
        if (STORE_SHARE) {
            occlusion[pixel.y * view.size.x + pixel.x] = vec4f(share, depth);
        }
        return;
    }
    occlusion[slot] = vec4f(arriving / count, depth);
    if (SAMPLE_ENVIRONMENT) {
        unoccluded[slot] = vec4f(emitted / count, 1.0);
    }
    normals[slot] = pack_view_normal(normal);
}

fn find_occlusion_of_grid(grid: vec2u) {
    let pattern = (grid.y % INTERLEAVE) * INTERLEAVE + grid.x % INTERLEAVE;
    find_occlusion(grid * STRIDE, grid.y * grid_size().x + grid.x, pattern);
}

// Runs per pixel of a tile that shows a surface.
@compute @workgroup_size(8, 8)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) thread: vec3u) {
    let pixel = pixel_of_tile(group, thread, view.size);
    if (all(pixel < view.size)) {
        find_occlusion_of_grid(pixel);
    }
}

// Runs per pixel of a coarser grid.
@compute @workgroup_size(8, 8)
fn coarse(@builtin(global_invocation_id) id: vec3u) {
    if (all(id.xy < grid_size())) {
        find_occlusion_of_grid(id.xy);
    }
}

// Runs per unrepresented pixel.
@compute @workgroup_size(LIST_GROUP)
fn listed(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let count = unrepresented_count();
    for (var slot = id.x; slot < count; slot += groups.x * LIST_GROUP) {
        let index = unrepresented[slot];
        find_occlusion(
            vec2u(index % view.size.x, index / view.size.x), slot, hash(index) % (INTERLEAVE * INTERLEAVE));
    }
}
