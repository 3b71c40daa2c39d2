// One invocation samples the irradiance of a requested cell of the radiance cache, at the hit that its rays voted for.
//
// In: requested cells, votes, hits, scene, means of the frames before. Out: the cell's update, W/m2. Errs by what
// `irradiance.wgsl` leaves out.
#import "scene/sequence.wgsl"
#import "shared/radiance_cache/votes.wgsl"
#import "shared/radiance_cache/irradiance.wgsl"

@group(1) @binding(19) var<uniform> params: Params;
@group(1) @binding(23) var<storage, read> requested: array<u32>;  // x, y, z workgroups; cells; the cells
@group(1) @binding(24) var<storage, read> hits: array<CacheHit>;
@group(1) @binding(25) var<storage, read_write> cells: array<Cell>;

struct Params {
    seed: u32,
}

const LIST_HEADER: u32 = 4u;
const UPDATE_GROUP: u32 = 64u;

@compute @workgroup_size(UPDATE_GROUP)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (id.x >= requested[3]) {
        return;
    }
    let cell = requested[LIST_HEADER + id.x];
    let number = hit_of_vote(table[2u * cell + 1u], vote_multiplier(sequence.index, params.seed));
    let hit = hits[number];
    let direction = octahedral_decode(unpack2x16snorm(hit.direction));
    let s = surface_at(Hit(0.0, hit.triangle, hit.instance, hit.from_anchor, UNTINTED), direction);
    let seed = hash2(table[2u * cell], params.seed);
    let index = select(0u, cells[cell].drawn, updates_of(cells[cell].state) > 0u);
    cells[cell].update = irradiance_by_path(s, index, seed);
}
