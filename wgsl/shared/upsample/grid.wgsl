// A grid of every STRIDE-th pixel of every STRIDE-th row of the picture, at which a technique computes its light.
#import "scene/info.wgsl"

override STRIDE: u32 = 1u;

fn grid_size() -> vec2u {
    return (view.size + STRIDE - 1u) / STRIDE;
}
