// Interleaved sampling: each pixel uses one of 16 sample patterns.
//
// Pixels 4 apart along rows and columns share a pattern, so threads of a workgroup read neighbouring texels and branch
// alike (Segovia et al. 2006, "Non-interleaved Deferred Shading of Interleaved Sample Patterns"). Patterns move from
// frame to frame of a still picture. Their arrangement in a 4x4 block in the first frame, x to the right:
//
//      0  2  8 10
//      3  1 11  9
//     12 14  4  6
//     15 13  7  5

const INTERLEAVE: u32 = 4u;  // pixels along the side of a block
const PATTERNS: u32 = INTERLEAVE * INTERLEAVE;
const CANDIDATES: u32 = 4u;  // samples of a group, from which one is drawn; a power of two
const RING_SEED: u32 = 0x68bc21ebu;

// Returns a pixel's number among 2x2: 0 2 / 3 1.
fn number_in_square(pixel: vec2u) -> u32 {
    return ((pixel.x ^ pixel.y) & 1u) * 2u + (pixel.y & 1u);
}

// Returns the number of a pixel's 2x2 square among those of its block, in the same order.
fn number_of_square(pixel: vec2u) -> u32 {
    return number_in_square(pixel >> vec2u(1u));
}

// Returns the pattern of a pixel. A square of 2x2 pixels takes all 16 patterns in 4 frames, each pixel in 16 frames.
// Over 8 frames adjacent pixels take different patterns, so no rows or columns show.
fn pattern_of(pixel: vec2u, frame: u32) -> u32 {
    return ((number_of_square(pixel) ^ frame) & 3u) * 4u + ((number_in_square(pixel) ^ (frame >> 2u)) & 3u);
}
