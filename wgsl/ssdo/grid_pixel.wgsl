// The pixels of a grid that the search starts from: one of each square of STRIDE pixels a side, its first one. With
// MOVES it lies at another corner of its square in each frame, so the mean of frames samples every pixel of the picture.
// Errs in the denoiser, which takes its planes, and the roughness of coats, at the first pixel of a square.
#import "ssdo/grid.wgsl"
#import "shared/upsample/corner.wgsl"
#import "scene/sequence.wgsl"

override MOVES: bool = false;  // needs a STRIDE of 2

// Returns the pixel of a place in the grid, in the picture.
fn grid_pixel(place: vec2u) -> vec2u {
    let corner = select(vec2u(0u), corner_of(sequence.index), MOVES);
    return min(place * STRIDE + corner, view.size - 1u);
}
