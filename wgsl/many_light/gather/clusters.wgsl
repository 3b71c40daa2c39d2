// Clusters of pixels that share a list of VPLs: tiles of the picture, cut into slices of distance.
//
// Slices are found by the bits of the distance as a float, which are close to its logarithm, so that each pass finds
// the same one, bit for bit.

override SLICES: u32 = 1u;  // of a tile; a power of two

const MAX_SLICES: u32 = 8u;

const TILE_X: u32 = 32u;  // pixels
const TILE_Y: u32 = 16u;

// The distances of a tile: the bits of the least, and how far to shift what lies above to find the slice.
struct Slicing {
    least: u32,
    shift: u32,
}

fn slicing(least: u32, largest: u32) -> Slicing {
    let range = largest - least;
    // Bits of the range, less those that number the slices.
    let bits = 32u - countLeadingZeros(range);
    let kept = firstTrailingBit(SLICES);
    return Slicing(least, select(0u, bits - kept, bits > kept));
}

fn slice_of(s: Slicing, distance_seen: f32) -> u32 {
    return min((bitcast<u32>(distance_seen) - s.least) >> s.shift, SLICES - 1u);
}

fn tile_of(pixel: vec2u, size: vec2u) -> u32 {
    return pixel.y / TILE_Y * ((size.x + TILE_X - 1u) / TILE_X) + pixel.x / TILE_X;
}

// Returns where lists begin in their buffer: after the slicings of all tiles, if there are any.
fn first_list(size: vec2u) -> u32 {
    let tiles = ((size.x + TILE_X - 1u) / TILE_X) * ((size.y + TILE_Y - 1u) / TILE_Y);
    return select(0u, 2u * tiles, SLICES > 1u);
}
