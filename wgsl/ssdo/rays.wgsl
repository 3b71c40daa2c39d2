// One invocation traces an undecided direction through the scene's hierarchy: it leaves the scene, or hits a surface.
//
// A hit on a matte surface that the picture shows becomes a hit of its pixel. Other hits get the radiance that they
// reflect back along the ray, L = sum f_r L_i cos, from a sample of the lights with a shadow ray
// (`deferred/hit_light.wgsl`). In: G-buffer, scene, the list of undecided directions. Out: their entries in `hits`; L in
// W/(m2 sr), 8 bits a channel. Exact but for L, which errs by what `hit_light.wgsl` leaves out.
#import "scene/sequence.wgsl"
#import "deferred/hit_light.wgsl"
#import "ssdo/trace_undecided.wgsl"

@group(1) @binding(19) var<uniform> params: Params;

struct Params {
    seed: u32,
}

const LIGHT_SEED: u32 = 0x27d4eb2fu;  // sets the sequences of lights apart from those of directions
const BLOCK: u32 = 4u;                // pixels on a side of a block that shares a low-discrepancy sequence

// Returns the radiance that a hit reflects along its ray.
fn light_of_hit(entry: HitEntry) -> vec3f {
    if ((entry.surface.flags & UNLIT) != 0u) {
        return vec3f(0.0);
    }
    let k = entry.index % (DIRECTIONS + LOBES);
    let cell = entry.pixel / STRIDE;
    let block = hash2(cell.x / BLOCK, hash2(cell.y / BLOCK, params.seed ^ LIGHT_SEED));
    let place = (cell.y % BLOCK) * BLOCK + cell.x % BLOCK;
    let number = (sequence.index * BLOCK * BLOCK + place) * (DIRECTIONS + LOBES) + k;
    return reflected_radiance(path_point(entry.surface, entry.direction), no_arrival(), number, block);
}

fn store_light(entry: HitEntry) {
    store_radiance(entry.index, entry.direction, entry.weight * light_of_hit(entry));
}

@compute @workgroup_size(LIST_GROUP)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let count = undecided_count();
    for (var place = id.x; place < count; place += groups.x * LIST_GROUP) {
        trace_direction(undecided_index(place));
    }
}
