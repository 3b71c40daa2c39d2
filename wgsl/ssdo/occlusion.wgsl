// One invocation finds which share of the environment's light reaches a pixel's surface, and what hides the rest:
// V = pi / (N E) sum_k L(w_k) V(w_k), with E the irradiance if nothing hid any (Ritschel et al. 2009, section 3: the sum
// of L_in V cos dw over N directions).
//
// Directions are drawn by the cosine; pixels of an n x n square share a stratified set of them among them, and the blur
// that follows averages over such squares. L is the environment filtered to about the solid angle of a direction of such
// a set, so a small sun casts a soft shadow. In: G-buffer, depths of all sources, the prefiltered environment. Out: V per
// channel, 1 in the mean where nothing is hidden, and the depth of `denoise/plane.wgsl`, 0 where there is nothing to light; the surface that each direction meets.
// Errs bright where what hides the light is not in any picture, dark behind what is thinner than it seems.
#import "scene/sequence.wgsl"
#import "gbuffer/load.wgsl"
#import "gbuffer/tiles.wgsl"
#import "environment/ambient.wgsl"
#import "common/random.wgsl"
#import "denoise/plane.wgsl"
#import "ssdo/march.wgsl"
#import "ssdo/reach.wgsl"

override DIRECTIONS: u32 = 1u;
override INTERLEAVE: u32 = 4u;      // n
override DIRECTIONAL: bool = true;  // else V = mean of V(w_k): ambient occlusion
override OUTWARD: bool = false;     // light the counter-clockwise side of surfaces, not the one that is seen
override HITS: bool = true;         // keep the surfaces
override LOBE: u32 = 2u;            // which of the environment's maps

@group(1) @binding(11) var<storage, read_write> occlusion: array<vec4f>;
@group(1) @binding(12) var<storage, read_write> normals: array<u32>;
@group(1) @binding(13) var<storage, read_write> hits: array<u32>;
@group(1) @binding(19) var<uniform> params: Params;

struct Params {
    seed: u32,
    pictures: f32,
}

// 2^32 over the golden ratio: its multiples spread evenly (Weyl).
const GOLDEN: u32 = 2654435769u;

// Returns what comes from a direction over the mean of the hemisphere.
fn sent_along(direction: vec3f, mean: vec3f) -> vec3f {
    if (!HAS_ENVIRONMENT || !HAS_PICTURED_ENVIRONMENT || !DIRECTIONAL) {
        return vec3f(1.0);
    }
    return load_ambient_map(LOBE, picture_from_world(direction)) / mean;
}

fn find_light(grid: vec2u) {
    let pixel = grid * STRIDE;
    let index = grid.y * grid_size().x + grid.x;
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
    let reach = reach_at(ray, seen, params.pictures);
    let m = marcher(position, frame, frame_from_normal(side), reach);
    let class_number = (grid.y % INTERLEAVE) * INTERLEAVE + grid.x % INTERLEAVE;
    let first = (sequence.index * INTERLEAVE * INTERLEAVE + class_number) * DIRECTIONS;
    var mean = vec3f(1.0);
    if (HAS_ENVIRONMENT && HAS_PICTURED_ENVIRONMENT && DIRECTIONAL) {
        mean = max(load_ambient_map(0u, picture_from_world(normal)), vec3f(1e-30));
    }
    var arriving = vec3f(0.0);
    for (var k = 0u; k < DIRECTIONS; k += 1u) {
        let local = sample_cosine_hemisphere(sobol_2d(first + k, params.seed));
        let direction = frame * local;
        var hit = march(m, local, unit_float((first + k) * GOLDEN));
        // Below the surface itself there is nothing to see.
        let below = dot(direction, side) <= 0.0;
        hit = select(hit, NO_HIT, below);
        var visible = select(1.0, 0.0, below);
        if (hit != NO_HIT) {
            visible = 1.0 - hit_weight(hit, hit_position(hit) - position, reach);
        }
        arriving += sent_along(direction, mean) * visible;
        if (HITS) {
            hits[index * DIRECTIONS + k] = hit;
        }
    }
    occlusion[index] = vec4f(arriving / f32(DIRECTIONS), plane_depth(ray, seen));
    normals[index] = pack_view_normal(normal);
}

// For each pixel of a seen tile.
@compute @workgroup_size(8, 8)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) thread: vec3u) {
    let pixel = pixel_of_tile(group, thread, view.size);
    if (all(pixel < view.size)) {
        find_light(pixel);
    }
}

// For each pixel of a coarser grid.
@compute @workgroup_size(8, 8)
fn coarse(@builtin(global_invocation_id) id: vec3u) {
    if (all(id.xy < grid_size())) {
        find_light(id.xy);
    }
}
