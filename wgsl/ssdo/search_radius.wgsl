// The radius r_max of the hemisphere searched for occluders, metres, and the fade of occluders towards its border and
// the picture's border.
//
// r_max is the scene's diameter, but at most `heights` times the height of the view at the receiver's depth: a larger
// radius would space steps too widely, and the picture shows nothing larger. So r_max does not depend on the size of
// geometry out of view.
#import "scene/info.wgsl"

// Occluders fade from this share of r_max on (Ritschel et al. 2009, section 7.2). tools/README.md, "Constants".
const FADE_START: f32 = 0.75;
// Width of the fade at the picture's border, in heights of the picture. tools/README.md, "Constants".
const BORDER_FADE: f32 = 0.01;

// Returns r_max in metres at a depth along the view, metres.
fn search_radius_at_depth(depth: f32, heights: f32) -> f32 {
    let view_height = 2.0 * length(view.up) * select(depth, 1.0, view.orthographic != 0u);
    return min(2.0 * scene.radius, heights * view_height);
}

// Returns r_max in metres at a distance along a pixel's ray, metres.
fn search_radius(ray: Ray, distance_seen: f32, heights: f32) -> f32 {
    return search_radius_at_depth(distance_seen * dot(ray.direction, view.forward), heights);
}

// Returns the weight of a surface by its distance from the receiver: 1, falling to 0 at r_max.
fn distance_fade(radius: f32, distance_off: f32) -> f32 {
    return 1.0 - smoothstep(FADE_START * radius, radius, distance_off);
}

// Returns the weight of a surface by its place in a picture, pixels: 0 at the border, so surfaces that enter the
// picture fade in.
fn border_fade(place: vec2f, size: vec2f) -> f32 {
    let from_border = min(place, size - place) / (BORDER_FADE * size.y);
    return clamp(min(from_border.x, from_border.y), 0.0, 1.0);
}
