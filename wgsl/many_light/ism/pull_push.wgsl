// One workgroup closes the gaps between the single texels of 64 x 64 of the atlas: the pull and the push phase of
// Marroquim et al. 2007, "Efficient Point-Based Rendering Using Image Reconstruction", in workgroup memory.
//
// Pull: an element is the nearest point of its four children, and where that is. Push: a block becomes the nearest of
// the points of the four coarser elements around it that reach it, unless its own point is not farther away by more than
// the depth interval. Departures: nothing is averaged, because a point is a plane, which is met at another distance in
// each direction; a point reaches as far as its area is seen, foreshortened; the pyramid has two levels, of blocks and
// of four blocks: what no point reaches takes the plane of the ray next to it.
//
// In: single texels. Out: the atlas. A tile holds several small maps or a part of a large one; nothing crosses the
// border of a map or of a tile. Errs dark at convex edges, where planes are drawn out, and bright where points before
// those of rays are farther apart than they reach.
#import "many_light/ism/map.wgsl"
#import "many_light/ism/radius.wgsl"

@group(1) @binding(11) var<storage, read> drawn: array<u32>;
@group(1) @binding(12) var atlas: texture_storage_2d<r32uint, write>;

@group(1) @binding(19) var<uniform> params: Params;

struct Params {
    per_map: u32,   // points of all surfaces in a map
    reach: f32,     // how far a point reaches, over its radius
    interval: f32,  // depth interval, over a point's radius
}

const TILE: u32 = 64u;
// By how much a plane may be nearer than it was, a texel away: half a step of the slopes.
const SLOPE_ERROR: f32 = 0.5 * SLOPE_STEP * 0.6931472 / (2.0 * CODES_PER_OCTAVE);
const THREADS: u32 = 64u;

// Elements are code << 16 | y << 6 | x of a point's texel in the tile, 0 for none.
const BLOCKS: u32 = TILE / BLOCK;  // on a side
const COARSE: u32 = BLOCKS / 2u;
var<workgroup> blocks: array<u32, 1024>;
var<workgroup> coarse: array<u32, 256>;

fn load_drawn(tile: vec2u, at: vec2u) -> u32 {
    return drawn[(tile.y + at.y) * textureDimensions(atlas).x + tile.x + at.x];
}

fn drawn_element(tile: vec2u, at: vec2u) -> u32 {
    let code = load_drawn(tile, at) & 0xffff0000u;
    return select(0u, code | (at.y << 6u) | at.x, code > 0u);
}

// Returns the direction of a place of a tile in the frame of its map, texels.
fn tile_direction(tile: vec2u, place: vec2f) -> vec3f {
    return map_direction(vec2f(tile & vec2u(ISM_RESOLUTION - 1u)) + fract(place / f32(ISM_RESOLUTION)) * f32(ISM_RESOLUTION));
}

// A point as the elements around it see it.
struct Point {
    plane: vec3f,
    place: vec2f,  // texels of the tile
    reach: f32,    // texels; negative: there is no point
    depth: f32,    // interval, over the distance
}

fn point_of(tile: vec2u, element: u32) -> Point {
    let at = vec2u(element, element >> 6u) & vec2u(63u);
    let place = vec2f(at) + 0.5;
    let texel = load_drawn(tile, at);
    let distance = code_distance(f32(texel >> 16u));
    let plane = texel_plane(tile_direction(tile, place), distance, texel_slopes(texel));
    // The plane's distance from the light is 1 / |m|: over the point's, that is the cosine.
    let cosine = inverseSqrt(max(dot(plane, plane), 1e-37)) / distance;
    let radius = point_radius(distance, params.per_map);
    let reach = min(params.reach * radius * sqrt(cosine), RAY_RADIUS * f32(SPACING));
    let depth = params.interval * min(radius, RAY_RADIUS * f32(SPACING)) * (2.5 / f32(ISM_RESOLUTION));
    return Point(plane, place, select(-1.0, reach, element != 0u), depth);
}

// Returns a coarse element, none beyond the tile.
fn coarse_at(at: vec2i) -> u32 {
    let inside = all(at >= vec2i(0)) && all(at < vec2i(i32(COARSE)));
    let place = clamp(at, vec2i(0), vec2i(i32(COARSE) - 1));
    return select(0u, coarse[u32(place.y) * COARSE + u32(place.x)], inside);
}

// The points of the four coarse elements around a corner that four blocks share.
struct Around {
    planes: mat4x3f,
    x: vec4f,
    y: vec4f,
    reach: vec4f,
    depth: vec4f,
}

fn load_around(tile: vec2u, at: vec2i) -> Around {
    let a = point_of(tile, coarse_at(at));
    let b = point_of(tile, coarse_at(at + vec2i(1, 0)));
    let c = point_of(tile, coarse_at(at + vec2i(0, 1)));
    let d = point_of(tile, coarse_at(at + vec2i(1, 1)));
    return Around(
        mat4x3f(a.plane, b.plane, c.plane, d.plane), vec4f(a.place.x, b.place.x, c.place.x, d.place.x),
        vec4f(a.place.y, b.place.y, c.place.y, d.place.y), vec4f(a.reach, b.reach, c.reach, d.reach),
        vec4f(a.depth, b.depth, c.depth, d.depth));
}

// Returns the texels of a block, given the points around it.
fn push(tile: vec2u, block: vec2u, around: Around) -> vec4u {
    let centre = vec2f(BLOCK * block) + 0.5 * f32(BLOCK);
    let w = tile_direction(tile, centre);
    let dx = around.x - centre.x;
    let dy = around.y - centre.y;
    // Maps smaller than a tile have neighbours in it.
    let shift = vec4u(firstTrailingBit(min(ISM_RESOLUTION, TILE)));
    let same_map = (vec4u(around.x) >> shift == vec4u(u32(centre.x)) >> shift)
        & (vec4u(around.y) >> shift == vec4u(u32(centre.y)) >> shift);
    let reached = (around.reach >= vec4f(0.0)) & (dx * dx + dy * dy <= around.reach * around.reach) & same_map;
    let off = 1.0 - SLOPE_ERROR * (abs(dx) + abs(dy));
    let inverse = select(vec4f(0.0), w * around.planes * off, reached);
    let nearest = max(max(inverse.x, inverse.y), max(inverse.z, inverse.w));
    let is = inverse == vec4f(nearest);
    let depth = select(
        select(around.depth.w, around.depth.z, is.z), select(around.depth.y, around.depth.x, is.x), is.x || is.y);
    let plane = select(
        select(around.planes[3], around.planes[2], is.z), select(around.planes[1], around.planes[0], is.x),
        is.x || is.y);
    // Its own point stays unless it lies behind the interval of what covers it; who has none takes that of a ray.
    let own = blocks[block.y * BLOCKS + block.x];
    let place = tile + vec2u(centre);
    let map = place & ~vec2u(ISM_RESOLUTION - 1u);
    let corner = (place - map + SPACING / 2u) & vec2u(~(SPACING - 1u));
    let ray = drawn_element(tile, clamp(map + ray_texel(corner), tile, tile + TILE - 1u) - tile);
    let mine = select(own, ray, own == 0u);
    let point = point_of(tile, mine);
    let away = abs(point.place - centre);
    let straight = max(dot(w, point.plane), 1e-30);
    let here = select(0.0, straight * (1.0 - SLOPE_ERROR * (away.x + away.y)), mine != 0u);
    let keeps = nearest <= 0.0 || (own != 0u && here * (1.0 + depth) >= nearest);
    let kept = point.plane * (here / straight);
    return block_texels(w, select(plane * (nearest / max(dot(w, plane), 1e-30)), kept, keeps));
}

fn nearest_of(a: u32, b: u32, c: u32, d: u32) -> u32 {
    return max(max(a, b), max(c, d));
}

@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) thread: u32) {
    let tile = group.xy * TILE;
    for (var i = thread; i < BLOCKS * BLOCKS; i += THREADS) {
        let at = 2u * vec2u(i % BLOCKS, i / BLOCKS);
        blocks[i] = nearest_of(
            drawn_element(tile, at), drawn_element(tile, at + vec2u(1u, 0u)), drawn_element(tile, at + vec2u(0u, 1u)),
            drawn_element(tile, at + vec2u(1u, 1u)));
    }
    workgroupBarrier();
    for (var i = thread; i < COARSE * COARSE; i += THREADS) {
        let first = i / COARSE * 2u * BLOCKS + i % COARSE * 2u;
        coarse[i] = nearest_of(blocks[first], blocks[first + 1u], blocks[first + BLOCKS], blocks[first + BLOCKS + 1u]);
    }
    workgroupBarrier();
    // Four blocks between four coarse elements, from one before the first.
    let side = COARSE + 1u;
    for (var i = thread; i < side * side; i += THREADS) {
        let at = vec2i(vec2u(i % side, i / side)) - 1;
        let around = load_around(tile, at);
        for (var k = 0; k < 4; k += 1) {
            let block = vec2u(2 * at + 1 + vec2i(k & 1, k >> 1));
            // Negative ones are large as unsigned.
            if (all(block < vec2u(BLOCKS))) {
                let texels = push(tile, block, around);
                let to = tile + BLOCK * block;
                textureStore(atlas, to, vec4u(texels.x));
                textureStore(atlas, to + vec2u(1u, 0u), vec4u(texels.y));
                textureStore(atlas, to + vec2u(0u, 1u), vec4u(texels.z));
                textureStore(atlas, to + vec2u(1u, 1u), vec4u(texels.w));
            }
        }
    }
}
