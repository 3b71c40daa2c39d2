// Interleaved sampling (Keller and Heidrich 2001): the n x n pixels of a square are n^2 classes that use different
// samples, and the classes go round the pixels from frame to frame.

override INTERLEAVE: u32 = 4u;  // n

fn class_count() -> u32 {
    return INTERLEAVE * INTERLEAVE;
}

// Has no common divisor with the square of an INTERLEAVE of up to 8.
const CLASS_STEP: u32 = 11u;

// Returns the class whose VPLs a pixel sees: they go round from frame to frame of a still picture, so that in the mean
// each pixel sees all of them.
fn class_of(pixel: vec2u, frame: u32) -> u32 {
    let own = pixel % INTERLEAVE;
    return (own.y * INTERLEAVE + own.x + frame * CLASS_STEP) % class_count();
}
