// The grid of pixels that the search starts from: every STRIDE-th pixel of every STRIDE-th row.
#import "scene/info.wgsl"

override STRIDE: u32 = 1u;

fn grid_size() -> vec2u {
    return (view.size + STRIDE - 1u) / STRIDE;
}
