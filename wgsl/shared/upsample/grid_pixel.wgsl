// The pixels of a grid: one of each square of STRIDE pixels a side, its first one. With MOVES it lies at another corner
// of its square in each frame, so the mean of frames samples every pixel of the picture.
#import "shared/upsample/grid.wgsl"
#import "shared/upsample/corner.wgsl"
#import "scene/sequence.wgsl"

override MOVES: bool = false;  // needs a STRIDE of 2

// Returns the place of the grid's pixel in its square.
fn grid_corner() -> vec2u {
    return select(vec2u(0u), corner_of(sequence.index), MOVES);
}

// Returns the pixel of a place in the grid, in the picture.
fn grid_pixel(place: vec2u) -> vec2u {
    return min(place * STRIDE + grid_corner(), view.size - 1u);
}
