// Interleaved sampling (Keller and Heidrich 2001): the n x n pixels of a square form n^2 classes, each with its own
// samples. Classes rotate over the pixels from frame to frame.

override INTERLEAVE: u32 = 4u;  // n

fn class_count() -> u32 {
    return INTERLEAVE * INTERLEAVE;
}

// A pixel advances by this many classes per frame. The step is coprime to n^2 for every n up to 8, so a pixel visits
// all classes.
const CLASS_STEP: u32 = 11u;

// Returns the class of a pixel in a frame of a still picture.
fn class_of(pixel: vec2u, frame: u32) -> u32 {
    let own = pixel % INTERLEAVE;
    return (own.y * INTERLEAVE + own.x + frame * CLASS_STEP) % class_count();
}
