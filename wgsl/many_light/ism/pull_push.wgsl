// One workgroup closes the gaps between the samples of 64 x 64 texels of the atlas by pull-push (Marroquim et al. 2007,
// "Efficient Point-Based Rendering Using Image Reconstruction"; Linke 2016, section 3.3.2).
//
// Pull: an element of the pyramid is the nearest sample among its four children. Push: a block of 2 x 2 texels takes
// the nearest plane of the four coarser elements around it whose samples reach it, unless its own sample lies less than
// a depth interval behind that plane. In: `samples`. Out: the atlas. A tile holds several small maps or a part of a
// large one; nothing crosses the border of a map or of a tile.
//
// Departures: samples are planes, whose distance varies with direction, so nothing is averaged; a sample's radius is
// foreshortened; the pyramid has two levels, and blocks that no sample reaches take the nearest ray's plane. Errs dark
// at convex edges, where pushing extends planes, and bright where near samples lie farther apart than their reach.
#import "many_light/ism/map.wgsl"
#import "many_light/ism/point_radius.wgsl"

@group(1) @binding(11) var<storage, read> samples: array<u32>;
@group(1) @binding(12) var atlas: texture_storage_2d<r32uint, write>;

@group(1) @binding(19) var<uniform> params: Params;

struct Params {
    points_per_map: u32,
    push_reach: f32,      // reach of a sample, over its radius
    depth_interval: f32,  // over a sample's radius
}

const TILE: u32 = 64u;  // texels on a side
const THREADS: u32 = 64u;
// Relative error of a plane's distance one texel off: half a step of its slope.
const SLOPE_ERROR: f32 = 0.5 * SLOPE_STEP * 0.6931472 / (2.0 * CODES_PER_OCTAVE);

// The pyramid. An element is code << 16 | y << 6 | x, with the texel x, y of its sample in the tile; 0: no sample.
const BLOCKS: u32 = TILE / BLOCK;  // on a side
const COARSE: u32 = BLOCKS / 2u;
var<workgroup> blocks: array<u32, 1024>;
var<workgroup> coarse: array<u32, 256>;

fn load_sample(tile: vec2u, at: vec2u) -> u32 {
    return samples[(tile.y + at.y) * textureDimensions(atlas).x + tile.x + at.x];
}

fn sample_element(tile: vec2u, at: vec2u) -> u32 {
    let code = load_sample(tile, at) & 0xffff0000u;
    return select(0u, code | (at.y << 6u) | at.x, code > 0u);
}

// Returns the unit direction, in the frame of its map, of a place of a tile, texels.
fn tile_direction(tile: vec2u, place: vec2f) -> vec3f {
    let inside = fract(place / f32(ISM_RESOLUTION)) * f32(ISM_RESOLUTION);
    return map_direction(vec2f(tile & vec2u(ISM_RESOLUTION - 1u)) + inside);
}

struct Sample {
    plane: vec3f,
    place: vec2f,     // texels of the tile
    reach: f32,       // texels; negative: there is no sample
    interval: f32,    // depth interval over the distance
}

fn sample_of(tile: vec2u, element: u32) -> Sample {
    let at = vec2u(element, element >> 6u) & vec2u(63u);
    let place = vec2f(at) + 0.5;
    let texel = load_sample(tile, at);
    let distance = code_distance(f32(texel >> 16u));
    let plane = texel_plane(tile_direction(tile, place), distance, texel_slopes(texel));
    // The plane is 1 / |m| away from the VPL; divided by the sample's distance, this is the cosine of the angle of
    // incidence.
    let cosine = inverseSqrt(max(dot(plane, plane), 1e-37)) / distance;
    let radius = point_radius(distance, params.points_per_map);
    let reach = min(params.push_reach * radius * sqrt(cosine), RAY_RADIUS * f32(RAY_SPACING));
    let interval =
        params.depth_interval * min(radius, RAY_RADIUS * f32(RAY_SPACING)) * (TEXEL_ANGLE / f32(ISM_RESOLUTION));
    return Sample(plane, place, select(-1.0, reach, element != 0u), interval);
}

// Returns a coarse element; 0 (no sample) beyond the tile.
fn coarse_at(at: vec2i) -> u32 {
    let inside = all(at >= vec2i(0)) && all(at < vec2i(i32(COARSE)));
    let place = clamp(at, vec2i(0), vec2i(i32(COARSE) - 1));
    return select(0u, coarse[u32(place.y) * COARSE + u32(place.x)], inside);
}

// The samples of the four coarse elements around a corner shared by four blocks, one per column or component.
struct Neighbours {
    planes: mat4x3f,
    x: vec4f,
    y: vec4f,
    reach: vec4f,
    interval: vec4f,
}

fn load_neighbours(tile: vec2u, at: vec2i) -> Neighbours {
    let a = sample_of(tile, coarse_at(at));
    let b = sample_of(tile, coarse_at(at + vec2i(1, 0)));
    let c = sample_of(tile, coarse_at(at + vec2i(0, 1)));
    let d = sample_of(tile, coarse_at(at + vec2i(1, 1)));
    return Neighbours(
        mat4x3f(a.plane, b.plane, c.plane, d.plane), vec4f(a.place.x, b.place.x, c.place.x, d.place.x),
        vec4f(a.place.y, b.place.y, c.place.y, d.place.y), vec4f(a.reach, b.reach, c.reach, d.reach),
        vec4f(a.interval, b.interval, c.interval, d.interval));
}

// Returns the texels of a block, given the samples of the coarse elements around it.
fn push(tile: vec2u, block: vec2u, neighbours: Neighbours) -> vec4u {
    let centre = vec2f(BLOCK * block) + 0.5 * f32(BLOCK);
    let w = tile_direction(tile, centre);
    let dx = neighbours.x - centre.x;
    let dy = neighbours.y - centre.y;
    // Find the samples of the same map that reach the block's centre; a tile may hold several maps.
    let shift = vec4u(firstTrailingBit(min(ISM_RESOLUTION, TILE)));
    let same_map = (vec4u(neighbours.x) >> shift == vec4u(u32(centre.x)) >> shift)
        & (vec4u(neighbours.y) >> shift == vec4u(u32(centre.y)) >> shift);
    let squared_reach = neighbours.reach * neighbours.reach;
    let reached = (neighbours.reach >= vec4f(0.0)) & (dx * dx + dy * dy <= squared_reach) & same_map;
    // Take the nearest of their planes at the centre.
    let off = 1.0 - SLOPE_ERROR * (abs(dx) + abs(dy));
    let inverse = select(vec4f(0.0), w * neighbours.planes * off, reached);
    let nearest = max(max(inverse.x, inverse.y), max(inverse.z, inverse.w));
    let is = inverse == vec4f(nearest);
    let interval = select(
        select(neighbours.interval.w, neighbours.interval.z, is.z),
        select(neighbours.interval.y, neighbours.interval.x, is.x), is.x || is.y);
    let plane = select(
        select(neighbours.planes[3], neighbours.planes[2], is.z),
        select(neighbours.planes[1], neighbours.planes[0], is.x), is.x || is.y);
    // The block keeps its own sample unless this lies more than the interval behind that plane. Without one, it keeps
    // the nearest ray's sample.
    let own = blocks[block.y * BLOCKS + block.x];
    let place = tile + vec2u(centre);
    let map = place & ~vec2u(ISM_RESOLUTION - 1u);
    let corner = (place - map + RAY_SPACING / 2u) & vec2u(~(RAY_SPACING - 1u));
    let ray = sample_element(tile, clamp(map + ray_texel(corner), tile, tile + TILE - 1u) - tile);
    let element = select(own, ray, own == 0u);
    let own_sample = sample_of(tile, element);
    let away = abs(own_sample.place - centre);
    let straight = max(dot(w, own_sample.plane), 1e-30);
    let here = select(0.0, straight * (1.0 - SLOPE_ERROR * (away.x + away.y)), element != 0u);
    let keeps = nearest <= 0.0 || (own != 0u && here * (1.0 + interval) >= nearest);
    let kept = own_sample.plane * (here / straight);
    return block_texels(w, select(plane * (nearest / max(dot(w, plane), 1e-30)), kept, keeps));
}

fn nearest_of(a: u32, b: u32, c: u32, d: u32) -> u32 {
    return max(max(a, b), max(c, d));
}

@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) thread: u32) {
    let tile = group.xy * TILE;
    // Pull the samples to blocks, and these to elements of four blocks.
    for (var i = thread; i < BLOCKS * BLOCKS; i += THREADS) {
        let at = 2u * vec2u(i % BLOCKS, i / BLOCKS);
        blocks[i] = nearest_of(
            sample_element(tile, at), sample_element(tile, at + vec2u(1u, 0u)),
            sample_element(tile, at + vec2u(0u, 1u)),
            sample_element(tile, at + vec2u(1u, 1u)));
    }
    workgroupBarrier();
    for (var i = thread; i < COARSE * COARSE; i += THREADS) {
        let first = i / COARSE * 2u * BLOCKS + i % COARSE * 2u;
        coarse[i] = nearest_of(blocks[first], blocks[first + 1u], blocks[first + BLOCKS], blocks[first + BLOCKS + 1u]);
    }
    workgroupBarrier();
    // Push: four blocks lie between four coarse elements, starting one element before the first.
    let side = COARSE + 1u;
    for (var i = thread; i < side * side; i += THREADS) {
        let at = vec2i(vec2u(i % side, i / side)) - 1;
        let neighbours = load_neighbours(tile, at);
        for (var k = 0; k < 4; k += 1) {
            let block = vec2u(2 * at + 1 + vec2i(k & 1, k >> 1));
            // Negative coordinates are large as unsigned ones.
            if (all(block < vec2u(BLOCKS))) {
                let texels = push(tile, block, neighbours);
                let to = tile + BLOCK * block;
                textureStore(atlas, to, vec4u(texels.x));
                textureStore(atlas, to + vec2u(1u, 0u), vec4u(texels.y));
                textureStore(atlas, to + vec2u(0u, 1u), vec4u(texels.z));
                textureStore(atlas, to + vec2u(1u, 1u), vec4u(texels.w));
            }
        }
    }
}
