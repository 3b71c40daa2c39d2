// The pixels that receive light in a frame: one of each square of the first level, at the same corner in all squares.
// Four frames visit all corners of a square of 2x2, so the mean of frames samples every pixel of the picture.

// Returns the corner of a square of 2x2 pixels, 0 or 1 right and down; `coarser`: levels of receivers above it.
fn corner_of(frame: u32, coarser: u32) -> vec2u {
    let number = frame >> (2u * coarser);
    return vec2u(number ^ (number >> 1u), number) & vec2u(1u);
}

// Returns the place of the receivers in their squares of `stride` pixels a side, a power of two.
fn receiver_place(frame: u32, stride: u32) -> vec2u {
    var place = vec2u(0u);
    var coarser = 0u;
    for (var side = stride >> 1u; side > 0u; side >>= 1u) {
        place += side * corner_of(frame, coarser);
        coarser += 1u;
    }
    return place;
}
