// One invocation sends rays from a pixel of the first level, and requests a cell of the radiance cache where one hits
// a surface that no pixel shows.
//
// In: surfels of the picture and of the first level, visibility, distances, scene. Out: hits; those whose light SSIL
// gathers, or that have none, have no cell.
#import "scene/sequence.wgsl"
#import "ssil/surfel.wgsl"
#import "ssil/offscreen/ray.wgsl"
#import "shared/radiance_cache/request.wgsl"
#import "shared/radiance_cache/hits.wgsl"

override SQUARE: u32 = 2u;  // picture pixels per side of a pixel of the first level

@group(1) @binding(11) var surfels: texture_2d<u32>;
@group(1) @binding(12) var fine_surfels: texture_2d<u32>;
@group(1) @binding(19) var<uniform> params: Params;
@group(1) @binding(24) var<storage, read_write> hits: array<CacheHit>;

struct Params {
    seed: u32,
    rays: u32,  // per pixel
}

// Pairs of random numbers.
const DIRECTION_PAIR: u32 = 0u;
const PLACE_PAIR: u32 = 1u;

// Returns the pixel of the picture that a surfel of the first level comes from.
fn source_of(pixel: vec2u, texel: vec4u) -> vec2u {
    var found = SQUARE * pixel;
    for (var k = 0u; k < SQUARE * SQUARE; k += 1u) {
        let fine = min(SQUARE * pixel + vec2u(k % SQUARE, k / SQUARE), view.size - 1u);
        found = select(found, fine, all(textureLoad(fine_surfels, fine, 0).xyz == texel.xyz));
    }
    return found;
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(surfels);
    if (any(id.xy >= size)) {
        return;
    }
    let pixel = id.y * size.x + id.x;
    let texel = textureLoad(surfels, id.xy, 0);
    if (is_empty(texel)) {
        return;
    }
    let seed = hash2(pixel, params.seed);
    let start = shown_surface(source_of(id.xy, texel));
    let frame = frame_from_normal(start.normal);
    // Always `params.rays`: lavapipe compiles loops up to a uniform anew for each dispatch.
    let rays = select(params.rays, 0u, is_empty(texel));
    for (var k = 0u; k < rays; k += 1u) {
        let number = pixel * rays + k;
        let index = sequence.index * rays + k;
        let local = sample_cosine_hemisphere(sobol_2d(index, hash2(DIRECTION_PAIR, seed)));
        let found = offscreen_hit(start, frame * local);
        hits[number] = no_cache_hit();
        if (found.hit.triangle != NONE) {
            let key = cell_key(found.surface.position, found.side, sobol_2d(index, hash2(PLACE_PAIR, seed)));
            let cell = request_cell(key, number, vote_multiplier(sequence.index, params.seed));
            hits[number] = cache_hit(found.hit, found.direction, cell, found.reflectance);
        }
    }
}
