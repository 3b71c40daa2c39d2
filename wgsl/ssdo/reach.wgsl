// How far screen space is searched, r_max, and how much what is found there counts.
//
// r_max is the scene's diameter, but at most as many heights of what the camera shows at the pixel's distance as
// `pictures`: farther off the points of a direction would lie too sparsely, and nothing larger than the picture can be
// seen anyway. So it does not depend on the size of what lies beyond the view.
#import "scene/info.wgsl"

// Share of the reach from which on occluders fade (section 7.2). Chosen.
const FADE_FROM: f32 = 0.75;
// Of the picture's height. Chosen.
const EDGE_FADE: f32 = 0.01;

// Returns r_max in metres at a depth along the view, metres.
fn reach_at_depth(depth: f32, pictures: f32) -> f32 {
    let tall = 2.0 * length(view.up) * select(depth, 1.0, view.orthographic != 0u);
    return min(2.0 * scene.radius, pictures * tall);
}

fn reach_at(ray: Ray, seen: f32, pictures: f32) -> f32 {
    return reach_at_depth(seen * dot(ray.direction, view.forward), pictures);
}

// Returns how much a surface counts that is so far off: less towards the border of the hemisphere.
fn share_within(reach: f32, distance_off: f32) -> f32 {
    return 1.0 - smoothstep(FADE_FROM * reach, reach, distance_off);
}

// Returns how much what a place of a picture shows counts, in pixels: less within EDGE_FADE of its border, so that it
// does not come and go at once.
fn share_inside(place: vec2f, size: vec2f) -> f32 {
    let from_edge = min(place, size - place) / (EDGE_FADE * size.y);
    return clamp(min(from_edge.x, from_edge.y), 0.0, 1.0);
}
