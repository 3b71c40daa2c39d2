// Clusters of pixels that share a light list: tiles of the picture (Linke 2016, section 4.6.2), or slices of tiles by
// distance (section 4.6.1; Olsson et al. 2012).
//
// The slices of a tile are equal ranges of the bits of the distance as a float, from its least to its largest distance:
// these bits grow nearly like the logarithm. Integer arithmetic gives a pixel the same slice in every pass.

override SLICES: u32 = 1u;  // per tile, a power of two; 1: tiles only

const MAX_SLICES: u32 = 8u;

const TILE_X: u32 = 32u;  // pixels
const TILE_Y: u32 = 16u;

// How a tile is sliced: the bits of its least distance, and the shift from the bits above it to the slice.
struct Slicing {
    least: u32,
    shift: u32,
}

fn slicing(least: u32, largest: u32) -> Slicing {
    let range = largest - least;
    // Keep as many bits of the range as number the slices.
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

// Returns the start of the lists in their buffer: if there are slices, after the slicings of all tiles.
fn first_list(size: vec2u) -> u32 {
    let tiles = ((size.x + TILE_X - 1u) / TILE_X) * ((size.y + TILE_Y - 1u) / TILE_Y);
    return select(0u, 2u * tiles, SLICES > 1u);
}
