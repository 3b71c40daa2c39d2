// How far screen space is searched, r_max, and the grid of pixels that is.
//
// r_max is the scene's diameter, but at most as many heights of what the camera shows at the pixel's distance as
// `params.pictures`: farther off the points of a direction would lie too sparsely, and nothing larger than the picture
// can be seen anyway. So it does not depend on the size of what lies beyond the view.
#import "scene/info.wgsl"

override STRIDE: u32 = 1u;  // pixels from one of the grid to the next

fn reach_at(ray: Ray, seen: f32, pictures: f32) -> f32 {
    let depth = select(seen * dot(ray.direction, view.forward), 1.0, view.orthographic != 0u);
    return min(2.0 * scene.radius, pictures * 2.0 * length(view.up) * depth);
}

fn grid_size() -> vec2u {
    return (view.size + STRIDE - 1u) / STRIDE;
}
