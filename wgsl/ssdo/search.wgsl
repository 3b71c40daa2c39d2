// One invocation computes the share of the environment's light that reaches a receiver, per channel, and its occluders:
// V = pi / (N E) sum_k L(w_k) V(w_k), with E the unoccluded irradiance (Ritschel et al. 2009, section 3: the sum
// of L_in V cos dw over N directions).
//
// Directions are drawn by the cosine. The pixels of an n x n square share one stratified set of directions, and the
// following blur averages over such squares. L is the environment filtered to about the solid angle of one direction of
// a set, so a small sun casts a soft shadow. With SAMPLE_ENVIRONMENT every other direction is drawn by importance
// sampling of the environment (balance heuristic, Veach and Guibas 1995), L is unfiltered, and the blur divides the
// sums with and without V. A pixel of a narrow coat also finds the hits of LOBES directions drawn from it; V stays
// that of the others. In: G-buffer, depths of all sources, the prefiltered environment. Out: V, whose mean is 1 without
// occluders, and the depth of `shared/denoise/plane.wgsl`, 0 where there is nothing to light; the surface that each
// direction hits. Errs bright where the occluder is in no view, dark behind occluders thinner than assumed.
#import "scene/sequence.wgsl"
#import "shared/gbuffer/load.wgsl"
#import "shared/gbuffer/tiles.wgsl"
#import "shared/denoise/plane.wgsl"
#import "ssdo/march_known.wgsl"
#import "ssdo/directions.wgsl"
#import "ssdo/undecided.wgsl"
#import "ssdo/lobe.wgsl"
#import "shared/upsample/grid_pixel.wgsl"
#import "shared/upsample/unrepresented.wgsl"

override DIRECTIONS: u32 = 1u;             // N
override LOBES: u32 = 0u;                  // further directions of coated pixels, drawn from the coat
override INTERLEAVE: u32 = 4u;             // n
override OUTWARD: bool = false;            // light the counter-clockwise side of surfaces, not the visible side
override HITS: bool = true;                // store the surfaces
override UNREPRESENTED: bool = false;      // process unrepresented pixels only
override STORE_SHARE: bool = true;         // store V of unrepresented pixels
override BY_RAYS: bool = false;            // list undecided directions instead of guessing
override MARCHES: bool = true;             // false: all directions are undecided

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

// What a direction finds: the hit's two words of `ssdo/hit_code.wgsl`, and how much of the environment it sees.
struct Outcome {
    hit: u32,
    code: u32,
    visible: f32,
}

// Returns what the pictures show along a direction; what they do not show is free. `factor`: on the weight.
fn find(
    m: Marcher, position: vec3f, frame: mat3x3f, normal: vec3f, side: vec3f, direction: vec3f, factor: f32, jitter: f32
) -> Outcome {
    // Directions below the surface see nothing.
    if (dot(direction, side) <= 0.0) {
        return Outcome(NO_HIT, 0u, 0.0);
    }
    let hit = march(m, direction * frame, jitter);
    if (hit == NO_HIT) {
        return Outcome(NO_HIT, 0u, 1.0);
    }
    let to_hit = hit_position(hit) - position;
    let weight = hit_weight(hit, to_hit, m.radius);
    let along = to_hit * inverseSqrt(max(dot(to_hit, to_hit), 1e-30));
    let sine = dot(normal, along);
    let arrival = HitDirection(along, select(0.0, weight * factor, sine > 0.0), sine > LEAST_SINE, false);
    return Outcome(hit, pack_hit_direction(arrival), 1.0 - weight);
}

// Returns what the pictures show along a direction, or that it is undecided. As in the path tracer, directions below a
// triangle with a tilted normal leave it on the other side.
fn find_known(
    m: Marcher, position: vec3f, frame: mat3x3f, side: vec3f, direction: vec3f, factor: f32, jitter: f32
) -> Outcome {
    var hit = UNKNOWN_HIT;
    if (MARCHES && dot(direction, side) > 0.0) {
        hit = march_known(m, position, direction * frame, direction, jitter);
    }
    let code = select(
        pack_hit_direction(HitDirection(direction, factor, true, false)),
        pack2x16snorm(octahedral_encode(direction)), hit >= UNKNOWN_HIT);
    return Outcome(hit, code, select(0.0, 1.0, hit == NO_HIT));
}

// Lists the undecided ones of a pixel's `searched` directions.
fn list_undecided_of(slot: u32, searched: u32, count: u32) {
    var place = reserve_undecided(count, searched);
    for (var k = 0u; k < DIRECTIONS + LOBES && count > 0u; k += 1u) {
        let index = slot * (DIRECTIONS + LOBES) + k;
        if (k < searched && hits[index].x == UNKNOWN_HIT) {
            list_undecided(place, index);
            place += 1u;
        }
    }
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
    let mean = mean_radiance(normal);
    var undecided_count = 0u;
    var arriving = vec3f(0.0);
    var emitted = vec3f(0.0);
    for (var k = 0u; k < DIRECTIONS + LOBES; k += 1u) {
        let is_lobe = LOBES > 0u && k >= DIRECTIONS;
        if (is_lobe && !draws_lobe(brdf, DIRECTIONS > 0u)) {
            break;
        }
        // March along a direction.
        var number = first + k;
        var direction: vec3f;
        var sample_weight = 1.0;
        if (is_lobe) {
            number = first_lobe + k - DIRECTIONS;
            direction = sample_lobe(brdf, frame, -ray.direction, number, params.seed);
        } else {
            direction = draw_direction(frame, number, params.seed);
            sample_weight = direction_weight(direction, normal);
        }
        // Sample weights go up to 2, stored weights up to 1.
        let factor = select(1.0, 0.5 * sample_weight, SAMPLE_ENVIRONMENT && !is_lobe);
        let jitter = unit_float(number * GOLDEN);
        var found: Outcome;
        if (BY_RAYS) {
            found = find_known(m, position, frame, side, direction, factor, jitter);
        } else {
            found = find(m, position, frame, normal, side, direction, factor, jitter);
        }
        undecided_count += select(0u, 1u, found.hit == UNKNOWN_HIT);
        if (!is_lobe) {
            let light = radiance_from(direction, mean, params.lobe) * sample_weight;
            arriving += light * found.visible;
            emitted += light;
        }
        if (HITS) {
            hits[slot * (DIRECTIONS + LOBES) + k] = vec2u(found.hit, found.code);
        }
    }
    if (BY_RAYS) {
        let searched = select(DIRECTIONS, DIRECTIONS + LOBES, draws_lobe(brdf, DIRECTIONS > 0u));
        list_undecided_of(slot, searched, undecided_count);
    }
    // Store V, or both sums for the blur to divide.
    let count = f32(max(DIRECTIONS, 1u));
    let depth = plane_depth(ray, seen);
    if (UNREPRESENTED) {
        let share = select(arriving / count, arriving / max(emitted, vec3f(1e-30)), SAMPLE_ENVIRONMENT);
        if (STORE_SHARE) {
            occlusion[pixel.y * view.size.x + pixel.x] = vec4f(share, depth);
        }
        if (BY_RAYS && SAMPLE_ENVIRONMENT) {
            unoccluded[slot] = vec4f(emitted, 1.0);
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
    find_occlusion(grid_pixel(grid), grid.y * grid_size().x + grid.x, pattern);
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
