// A grid of every STRIDE-th pixel of every STRIDE-th row of the picture, at which a technique computes its light.
#import "scene/info.wgsl"

override STRIDE: u32 = 1u;

fn grid_size() -> vec2u {
    return (view.size + STRIDE - 1u) / STRIDE;
}

// Returns a place in the grid as one in the grid of the whole picture: what random numbers depend on.
fn whole_place(place: vec2u) -> vec2u {
    return place + view.corner / STRIDE;
}
