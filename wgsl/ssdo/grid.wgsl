// The grid of pixels that are searched for.
#import "scene/info.wgsl"

override STRIDE: u32 = 1u;  // pixels from one of them to the next

fn grid_size() -> vec2u {
    return (view.size + STRIDE - 1u) / STRIDE;
}
