// One invocation requests the cell of the radiance cache for an off-screen hit of an undecided direction.
//
// In: hits, the list of undecided directions, scene. Out: the cells of the hits.
#import "scene/sequence.wgsl"
#import "scene/surface.wgsl"
#import "shared/radiance_cache/request.wgsl"
#import "shared/radiance_cache/hits.wgsl"
#import "shared/upsample/list_group.wgsl"

@group(1) @binding(15) var<storage, read> undecided: array<u32>;
@group(1) @binding(19) var<uniform> params: Params;
@group(1) @binding(24) var<storage, read_write> cache_hits: array<CacheHit>;

struct Params {
    seed: u32,
}

const LIST_START: u32 = 8u;           // words before the list
const PLACE_SEED: u32 = 0x85ebca6bu;  // sets the places in cells apart from other random numbers

@compute @workgroup_size(LIST_GROUP)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let multiplier = vote_multiplier(sequence.index, params.seed);
    let count = undecided[3];
    for (var place = id.x; place < count; place += groups.x * LIST_GROUP) {
        let index = undecided[LIST_START + place];
        let stored = cache_hits[index];
        if (stored.triangle == NONE) {
            continue;
        }
        let direction = octahedral_decode(unpack2x16snorm(stored.direction));
        let s = surface_at(Hit(0.0, stored.triangle, stored.instance, stored.from_anchor, UNTINTED), direction);
        let side = select(-s.geometric_normal, s.geometric_normal, s.front);
        let key = cell_key(s.position, side, sobol_2d(sequence.index, hash2(index, params.seed ^ PLACE_SEED)));
        cache_hits[index].cell = request_cell(key, index, multiplier);
    }
}
