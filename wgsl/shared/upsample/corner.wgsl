// The corner of each square of 2x2 pixels that a grid of half resolution samples in a frame.

// Returns the corner, 0 or 1 right and down. Each four frames visit all corners. The order differs from four frames to
// the next, so the frames of a corner have all remainders modulo 4, 16, ..., as low-discrepancy sequences need.
fn corner_of(frame: u32) -> vec2u {
    var number = frame ^ (frame >> 16u);
    number ^= number >> 8u;
    number ^= number >> 4u;
    number ^= number >> 2u;
    return vec2u(number ^ (number >> 1u), number) & vec2u(1u);
}
