// Interleaved sampling (Keller and Heidrich 2001): the n x n pixels of a square are n^2 classes, each with samples of
// its own. Classes rotate over the pixels from frame to frame.

override INTERLEAVE: u32 = 4u;  // n

fn class_count() -> u32 {
    return INTERLEAVE * INTERLEAVE;
}

// Classes that a pixel advances by per frame: prime to the square of every INTERLEAVE up to 8, so a pixel takes all of
// them.
const CLASS_STEP: u32 = 11u;

// Returns the class of a pixel in a frame of a still picture.
fn class_of(pixel: vec2u, frame: u32) -> u32 {
    let own = pixel % INTERLEAVE;
    return (own.y * INTERLEAVE + own.x + frame * CLASS_STEP) % class_count();
}
