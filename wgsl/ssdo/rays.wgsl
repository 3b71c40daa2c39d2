// One invocation traces an undecided direction through the scene's hierarchy: it leaves the scene, or hits a surface.
//
// A hit on a matte surface that the picture shows becomes a hit of its pixel. Other hits get the radiance that they reflect back along the
// ray, L = sum f_r L_i cos, from a sample of the lights with a shadow ray (`deferred/hit_light.wgsl`). In: G-buffer,
// scene, the list of undecided directions. Out: their entries in `hits`; L in W/(m2 sr), 8 bits a channel. Exact but for
// L, which errs by what `hit_light.wgsl` leaves out.
#import "scene/sequence.wgsl"
#import "deferred/hit_light.wgsl"
#import "ssdo/directions.wgsl"
#import "ssdo/shown_surface.wgsl"
#import "ssdo/undecided_list.wgsl"

override NEEDS_LIGHT: bool = true;  // false: only whether it hits

@group(1) @binding(13) var<storage, read_write> hits: array<vec2u>;  // packed by `ssdo/hit_code.wgsl`
@group(1) @binding(19) var<uniform> params: Params;

struct Params {
    seed: u32,
}

const LIGHT_SEED: u32 = 0x27d4eb2fu;  // sets the sequences of lights apart from those of directions
const BLOCK: u32 = 4u;                // pixels on a side of a block that shares a low-discrepancy sequence

// Returns the pixel that shows a point of a matte surface, or `view.size`. `side`: geometric normal on the ray's side.
fn pixel_showing(point: vec3f, side: vec3f) -> vec2u {
    let pixel = pixel_of_point(point);
    if (any(pixel >= view.size)) {
        return view.size;
    }
    let shown = shown_surface(pixel);
    return select(view.size, pixel, shown.is_matte && is_on_surface(shown, point) && dot(shown.normal, side) > 0.0);
}

// Returns the radiance that a hit reflects; `index`: of its direction in `hits`, `pixel`: that it leaves.
fn light_of_hit(s: Surface, direction: vec3f, index: u32, pixel: vec2u) -> vec3f {
    if ((s.flags & UNLIT) != 0u) {
        return vec3f(0.0);
    }
    let k = index % (DIRECTIONS + LOBES);
    let cell = pixel / STRIDE;
    let block = hash2(cell.x / BLOCK, hash2(cell.y / BLOCK, params.seed ^ LIGHT_SEED));
    let place = (cell.y % BLOCK) * BLOCK + cell.x % BLOCK;
    let number = (sequence.index * BLOCK * BLOCK + place) * (DIRECTIONS + LOBES) + k;
    return reflected_radiance(path_point(s, direction), no_arrival(), number, block);
}

fn trace_direction(index: u32) {
    // The ray leaves the pixel's surface, on the side of the direction.
    let slot = slot_of(index);
    let pixel = pixel_of_slot(slot);
    let code = hits[index].y;
    let direction = octahedral_decode(unpack2x16snorm(code));
    let surface = load_surface(pixel);
    let seen = pixel_ray(pixel);
    let position = seen.origin + seen.direction * load_distance(pixel);
    let offset = ray_offset(surface.geometric_normal, pixel_terms(position));
    let ray = Ray(offset_origin(position, surface.geometric_normal, offset, direction), direction);
    if (!NEEDS_LIGHT) {
        let is_free = !trace_shadow(ray, FLOAT_MAX).occluded_a;
        hits[index] = vec2u(select(DARK_HIT, NO_HIT, is_free), code);
        return;
    }
    let hit = trace(ray, FLOAT_MAX);
    if (hit.triangle == NONE) {
        hits[index] = vec2u(NO_HIT, code);
        return;
    }
    // Find the light of the hit, in the picture or by a sample of the lights.
    var weight = 1.0;
    if (SAMPLE_ENVIRONMENT && index % (DIRECTIONS + LOBES) < DIRECTIONS) {
        weight = 0.5 * direction_weight(direction, surface.normal);
    }
    let s = surface_at(hit, direction);
    let side = select(-s.geometric_normal, s.geometric_normal, s.front);
    let shown = pixel_showing(s.position, side);
    if (all(shown < view.size)) {
        hits[index] = vec2u(pack_hit(shown, 0u), pack_hit_direction(HitDirection(direction, weight, true, false)));
        return;
    }
    let radiance = weight * light_of_hit(s, direction, index, pixel);
    hits[index] = vec2u(
        pack_radiance(select(vec3f(0.0), radiance, is_finite(radiance))),
        pack_hit_direction(HitDirection(direction, 1.0, true, true)));
}

@compute @workgroup_size(LIST_GROUP)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let count = undecided_count();
    for (var place = id.x; place < count; place += groups.x * LIST_GROUP) {
        trace_direction(undecided_index(place));
    }
}
