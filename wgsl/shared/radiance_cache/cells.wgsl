// The cells of the world-space radiance cache: a cell holds the irradiance of the surfaces in a cube that face alike.
//
// The key is a hash of the cube's place, its side and the direction of the normal. Sides are powers of two, at most
// CELL_ANGLE times the distance from the camera (Gautron 2020, "Real-Time Ray-Traced Ambient Occlusion of Complex Scenes
// using Spatial Hashing"). A table of buckets maps keys to cells. Errs where two keys have the same check, once in 3e8 look-ups.
#import "scene/info.wgsl"
#import "common/math.wgsl"
#import "common/random.wgsl"

// Side of a cell over its distance from the camera, at most. SSIL, 160x90, one bounce, 16 frames, relMSE with 1/16 and
// 1/8: Cornell's area light 0.0105, 0.0118; room with a curtain 0.098, 0.097; corridor 0.32, 0.34; courtyard 0.030,
// 0.030. A room whose light is nearly all out of view has 3,841 and 2,047 cells to update in a frame.
const CELL_ANGLE: f32 = 0.125;
// Smallest side over the radius of the scene: its cells have places of 18 bits.
const SMALLEST_SIDE: f32 = 7.6293945e-6;
// Cells of a bucket.
const BUCKET: u32 = 8u;
// A cell that no ray has hit for this number of frames is free again.
const OLDEST: u32 = 60u;
// A mean counts at most this number of updates, since the points that update a cell drift as the camera moves.
const MOST_UPDATES: u32 = 32u;
const NO_CELL: u32 = 0xffffffffu;

struct Cell {
    irradiance: vec3f,  // mean, W/m2
    state: u32,         // updates in the mean | frames since a ray hit it << 8 | version of the scene << 16
    update: vec3f,      // of this frame, W/m2
    drawn: u32,         // updates since the cell is known: each takes the next point of its sequence
}

struct CellKey {
    place: u32,  // selects the buckets
    check: u32,  // tells the keys of a bucket apart; not 0
}

// The scene that the cache is of.
struct CacheScene {
    version: u32,  // 16 bits, another one after each change
}

@group(0) @binding(9) var<uniform> cache_scene: CacheScene;

// Returns the number of updates that a cell's mean counts: none of those of an earlier version of the scene.
fn updates_of(state: u32) -> u32 {
    return select(0u, state & 255u, (state >> 16u) == cache_scene.version);
}

// Returns the side of the cells around a position, metres.
fn cell_side(position: vec3f) -> f32 {
    let apart = select(length(position - view.position), 2.0 * length(view.up), view.orthographic != 0u);
    let most = max(max(apart * CELL_ANGLE, scene.radius * SMALLEST_SIDE), SMALLEST_NORMAL);
    // The power of two below.
    return bitcast<f32>(bitcast<u32>(most) & 0x7f800000u);
}

// Returns the key of a surface point; the place is moved along the surface by a random part of the cell, `u`, so that
// the edges of cells do not show. `normal`: unit, on the side that is lit.
fn cell_key(position: vec3f, normal: vec3f, u: vec2f) -> CellKey {
    let side = cell_side(position);
    let frame = frame_from_normal(normal);
    let moved = position + side * ((u.x - 0.5) * frame[0] + (u.y - 0.5) * frame[1]);
    let place = bitcast<vec3u>(vec3i(floor(moved / side)));
    // One of 26 directions; those along the axes and the diagonals lie well within.
    let facing = vec3u(vec3i(round(normal * 1.5)) + 1);
    let kind = (bitcast<u32>(side) >> 23u) | (facing.x << 8u) | (facing.y << 10u) | (facing.z << 12u);
    let key = hash2(place.x, hash2(place.y, hash2(place.z, kind)));
    let check = hash2(place.z, hash2(place.x, hash2(place.y, ~kind)));
    return CellKey(key, max(check, 1u));
}

// Returns place `k` of the 2 BUCKET places that a key can have, those of two buckets, in a table of `cells` cells.
fn place_of(key: CellKey, k: u32, cells: u32) -> u32 {
    let bucket = select(key.place, hash(key.place), k >= BUCKET) % (cells / BUCKET);
    return bucket * BUCKET + k % BUCKET;
}
