// One invocation sends a ray from a pixel of the first level, and requests a cell of the radiance cache where it hits a
// surface that no pixel shows.
//
// In: surfels of the first level, the picture's distances, scene. Out: hits; those whose light SSIL gathers, or that
// have none, have no cell.
#import "scene/sequence.wgsl"
#import "ssil/surfel.wgsl"
#import "ssil/offscreen/ray.wgsl"
#import "shared/radiance_cache/request.wgsl"
#import "shared/radiance_cache/hits.wgsl"

@group(1) @binding(11) var surfels: texture_2d<u32>;
@group(1) @binding(19) var<uniform> params: Params;
@group(1) @binding(24) var<storage, read_write> hits: array<CacheHit>;

struct Params {
    seed: u32,
}

// Pairs of random numbers.
const DIRECTION_PAIR: u32 = 0u;
const PLACE_PAIR: u32 = 1u;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(surfels);
    if (any(id.xy >= size)) {
        return;
    }
    let number = id.y * size.x + id.x;
    let texel = textureLoad(surfels, id.xy, 0);
    hits[number] = no_cache_hit();
    if (is_empty(texel)) {
        return;
    }
    let block = ray_block(id.xy, params.seed);
    let index = ray_index(id.xy, sequence.index);
    let found = offscreen_hit(texel, sobol_2d(index, hash2(DIRECTION_PAIR, block)));
    if (found.hit.triangle != NONE) {
        let key = cell_key(found.surface.position, found.side, sobol_2d(index, hash2(PLACE_PAIR, block)));
        let cell = request_cell(key, number, vote_multiplier(sequence.index, params.seed));
        hits[number] = cache_hit(found.hit, found.direction, cell, found.reflectance);
    }
}
