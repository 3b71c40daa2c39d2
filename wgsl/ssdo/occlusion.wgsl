// One invocation finds which share of the environment's light reaches a pixel's surface, and what hides the rest:
// V = pi / (N E) sum_k L(w_k) V(w_k), with E the irradiance if nothing hid any (Ritschel et al. 2009, section 3: the
// sum of L_in V cos dw over N directions).
//
// Directions are drawn by the cosine; pixels of an n x n square share a stratified set of them among them, and the
// blur that follows averages over such squares. L is the environment filtered to about the solid angle of a
// direction of such a set, so a small sun casts a soft shadow. With BY_PICTURE every other direction is drawn by the
// environment's picture (balance heuristic, Veach and Guibas 1995), L is unfiltered, and the blur divides both sums.
// In: G-buffer, depths of all sources, the prefiltered environment. Out: V per channel, 1 in the mean where nothing
// is hidden, and the depth of `shared/denoise/plane.wgsl`, 0 where there is nothing to light; the surface that each
// direction meets.
// Errs bright where what hides the light is not in any picture, dark behind what is thinner than it seems.
#import "scene/sequence.wgsl"
#import "shared/gbuffer/load.wgsl"
#import "shared/gbuffer/tiles.wgsl"
#import "deferred/environment/ambient.wgsl"
#import "scene/environment_sampling.wgsl"
#import "common/random.wgsl"
#import "shared/denoise/plane.wgsl"
#import "ssdo/march.wgsl"
#import "ssdo/grid.wgsl"
#import "shared/upsample/unrepresented.wgsl"

override DIRECTIONS: u32 = 1u;
override INTERLEAVE: u32 = 4u;      // n
override DIRECTIONAL: bool = true;  // else V = mean of V(w_k): ambient occlusion
override OUTWARD: bool = false;     // light the counter-clockwise side of surfaces, not the one that is seen
override BY_PICTURE: bool = false;  // draw by the picture, too
override HITS: bool = true;         // keep the surfaces
override UNREPRESENTED: bool = false;  // find it for unrepresented pixels only
override SHARE: bool = true;           // keep V of unrepresented pixels
override LOBE: u32 = 2u;            // which of the environment's maps

@group(1) @binding(11) var<storage, read_write> occlusion: array<vec4f>;
@group(1) @binding(12) var<storage, read_write> normals: array<u32>;
@group(1) @binding(13) var<storage, read_write> hits: array<vec2u>;  // a hit and the way there
@group(1) @binding(14) var<storage, read_write> sent: array<vec4f>;  // V E with nothing hidden, of BY_PICTURE
@group(1) @binding(19) var<uniform> params: Params;

struct Params {
    seed: u32,
    pictures: f32,
}

// 2^32 over the golden ratio: its multiples spread evenly (Weyl).
const GOLDEN: u32 = 2654435769u;

struct Drawn {
    direction: vec3f,
    weight: f32,       // cosine over pi over the density
}

fn draw(frame: mat3x3f, number: u32) -> Drawn {
    if (!BY_PICTURE) {
        return Drawn(frame * sample_cosine_hemisphere(sobol_2d(number, params.seed)), 1.0);
    }
    let u = sobol_2d(number / 2u, hash2(number & 1u, params.seed));
    var direction = frame * sample_cosine_hemisphere(u);
    if ((number & 1u) != 0u) {
        direction = sample_environment(u).xyz;
    }
    let by_cosine = max(dot(frame[2], direction), 0.0) * INV_PI;
    let by_picture = environment_pdf(direction) / max(scene.environment_pdf, 1e-9);
    return Drawn(direction, 2.0 * by_cosine / max(by_cosine + by_picture, 1e-30));
}

// Returns what comes from a direction, over the mean of the hemisphere if that is known.
fn sent_along(direction: vec3f, mean: vec3f) -> vec3f {
    if (BY_PICTURE) {
        return environment_radiance(direction);
    }
    if (!HAS_ENVIRONMENT || !HAS_PICTURED_ENVIRONMENT || !DIRECTIONAL) {
        return vec3f(1.0);
    }
    return load_ambient_map(LOBE, picture_from_world(direction)) / mean;
}

// Finds what a pixel's directions meet; `slot` is where that is kept, `class_number` that in its square.
fn find_light(pixel: vec2u, slot: u32, class_number: u32) {
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
    // Each frame draws from other parts of the hemisphere for a pixel, so that its own mean settles, too.
    let classes = INTERLEAVE * INTERLEAVE;
    let first = (sequence.index * classes + (class_number + sequence.index * 5u) % classes) * DIRECTIONS;
    var mean = vec3f(1.0);
    if (HAS_ENVIRONMENT && HAS_PICTURED_ENVIRONMENT && DIRECTIONAL && !BY_PICTURE) {
        mean = max(load_ambient_map(0u, picture_from_world(normal)), vec3f(1e-30));
    }
    var arriving = vec3f(0.0);
    var whole = vec3f(0.0);
    for (var k = 0u; k < DIRECTIONS; k += 1u) {
        let drawn = draw(frame, first + k);
        let direction = drawn.direction;
        var hit = march(m, direction * frame, unit_float((first + k) * GOLDEN));
        // Below the surface itself there is nothing to see.
        let below = dot(direction, side) <= 0.0;
        hit = select(hit, NO_HIT, below);
        var visible = select(1.0, 0.0, below);
        var way = 0u;
        if (hit != NO_HIT) {
            let to_hit = hit_position(hit) - position;
            let share = hit_weight(hit, to_hit, reach);
            // Shares are kept up to 1, weights are up to 2.
            let kept = select(1.0, 0.5 * drawn.weight, BY_PICTURE);
            visible = 1.0 - share;
            if (HITS) {
                let along = to_hit * inverseSqrt(max(dot(to_hit, to_hit), 1e-30));
                let rises = dot(normal, along);
                way = pack_way(Way(along, select(0.0, share * kept, rises > 0.0), rises > FLAT));
            }
        }
        let light = sent_along(direction, mean) * drawn.weight;
        arriving += light * visible;
        whole += light;
        if (HITS) {
            hits[slot * DIRECTIONS + k] = vec2u(hit, way);
        }
    }
    let depth = plane_depth(ray, seen);
    if (UNREPRESENTED) {
        let share = select(arriving / f32(DIRECTIONS), arriving / max(whole, vec3f(1e-30)), BY_PICTURE);
        if (SHARE) {
            occlusion[pixel.y * view.size.x + pixel.x] = vec4f(share, depth);
        }
        return;
    }
    occlusion[slot] = vec4f(arriving / f32(DIRECTIONS), depth);
    if (BY_PICTURE) {
        sent[slot] = vec4f(whole / f32(DIRECTIONS), 1.0);
    }
    normals[slot] = pack_view_normal(normal);
}

fn find_light_of_grid(grid: vec2u) {
    let class_number = (grid.y % INTERLEAVE) * INTERLEAVE + grid.x % INTERLEAVE;
    find_light(grid * STRIDE, grid.y * grid_size().x + grid.x, class_number);
}

// For each pixel of a seen tile.
@compute @workgroup_size(8, 8)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) thread: vec3u) {
    let pixel = pixel_of_tile(group, thread, view.size);
    if (all(pixel < view.size)) {
        find_light_of_grid(pixel);
    }
}

// For each pixel of a coarser grid.
@compute @workgroup_size(8, 8)
fn coarse(@builtin(global_invocation_id) id: vec3u) {
    if (all(id.xy < grid_size())) {
        find_light_of_grid(id.xy);
    }
}

// For each unrepresented pixel.
@compute @workgroup_size(LIST_GROUP)
fn listed(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let count = unrepresented_count();
    for (var slot = id.x; slot < count; slot += groups.x * LIST_GROUP) {
        let index = unrepresented[slot];
        find_light(
            vec2u(index % view.size.x, index / view.size.x), slot, hash(index) % (INTERLEAVE * INTERLEAVE));
    }
}
