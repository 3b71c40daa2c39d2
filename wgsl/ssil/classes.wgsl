// How the patterns of samples are dealt out: pixels 4 apart along rows and columns are of one class and share theirs,
// so that threads that run in step read neighbouring texels and skip together (Segovia et al. 2006, "Non-interleaved
// Deferred Shading of Interleaved Sample Patterns"). They go round from frame to frame of a still picture.

override SAMPLES: u32 = 64u;  // of each pixel at each level

const SIDE: u32 = 4u;
const CLASSES: u32 = SIDE * SIDE;
const CLASS_STEP: u32 = 11u;           // has no common divisor with CLASSES
const RING_SEED: u32 = 0x68bc21ebu;

// Returns the pattern of the class of pixels whose first is at `first`.
fn pattern_of(first: vec2u, frame: u32) -> u32 {
    return (first.y * SIDE + first.x + frame * CLASS_STEP) % CLASSES;
}
