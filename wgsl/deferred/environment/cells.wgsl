// The environment map as a quadtree of cells in latitude and longitude, for sums over the whole sphere.
//
// A cell stores the mean direction of its light, so that a sun much smaller than its cell keeps its direction.
#import "common/math.wgsl"

struct Cell {
    light: vec4f,   // rgb: integral of the picture over the cell, a: solid angle, sr
    centre: vec4f,  // xyz: unit, mean direction by luminance, in the map's frame (rotation 0)
}

// The finest level has LEAVES_X x LEAVES_Y cells, each coarser level a quarter of these, down to 16 x 8. The cells of a
// level lie in Z-order: the cells of level l begin at LEAVES >> 2 l, and the children of cell i are 4 i to 4 i + 3.
const LEAVES_X: u32 = 512u;
const LEAVES_Y: u32 = 256u;
const LEAVES: u32 = LEAVES_X * LEAVES_Y;
const TOP_LEVEL: u32 = 5u;
const TOP_CELLS: u32 = LEAVES >> 10u;
const CELLS: u32 = 2u * LEAVES;  // with gaps between the levels

// Returns the bits of x spread out to the even places (x < 2^16).
fn spread_bits(x: u32) -> u32 {
    var b = (x | (x << 8u)) & 0x00ff00ffu;
    b = (b | (b << 4u)) & 0x0f0f0f0fu;
    b = (b | (b << 2u)) & 0x33333333u;
    return (b | (b << 1u)) & 0x55555555u;
}

// Returns the mean direction of a cell, weighted by luminance, or by solid angle if the cell is black.
fn cell_centre(by_light: vec3f, by_angle: vec3f) -> vec3f {
    return normalize_or(by_light, normalize_or(by_angle, vec3f(0.0, 1.0, 0.0)));
}
