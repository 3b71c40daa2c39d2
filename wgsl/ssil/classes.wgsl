// How the patterns of samples are dealt out: pixels 4 apart along rows and columns are of one class and share theirs,
// so that threads that run in step read neighbouring texels and skip together (Segovia et al. 2006, "Non-interleaved
// Deferred Shading of Interleaved Sample Patterns"). They go round from frame to frame of a still picture.

const SIDE: u32 = 4u;
const CLASSES: u32 = SIDE * SIDE;
const RING_SEED: u32 = 0x68bc21ebu;

// A pixel among 4x4: its number among 2x2, diagonal neighbours following each other, and that of these.
fn place_in_square(pixel: vec2u) -> u32 {
    return ((pixel.x ^ pixel.y) & 1u) * 2u + (pixel.y & 1u);
}

fn square_of(pixel: vec2u) -> u32 {
    return place_in_square(pixel >> vec2u(1u));
}

// Returns the pattern of a class of pixels: in four frames each 2x2 pixels have all of them, in 16 each pixel has. In
// eight those above each other differ, and those beside each other, so that neither rows nor columns show.
fn pattern_of(pixel: vec2u, frame: u32) -> u32 {
    return ((square_of(pixel) ^ frame) & 3u) * 4u + ((place_in_square(pixel) ^ (frame >> 2u)) & 3u);
}

// Returns the quarter of its pattern that a pixel takes: each of 2x2 pixels another of the same pattern, wherever that
// comes in four frames, so that what a smoothing over 2x2 leaves is the same in all places.
fn quarter_of(pixel: vec2u, frame: u32) -> u32 {
    return place_in_square(pixel) ^ square_of(pixel) ^ (frame & 3u);
}
