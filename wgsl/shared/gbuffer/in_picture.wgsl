// Whether the picture shows a surface point: techniques of screen space find its light themselves.
#import "scene/info.wgsl"
#import "shared/gbuffer/distance.wgsl"

// Points count as seen if the pixel's point lies within this number of pixel widths of their plane.
const SAME_PLANE: f32 = 1.0;

// Returns the pixel onto which a point in the picture falls.
fn pixel_in_picture(position: vec3f) -> vec2u {
    let clip = view.clip_from_world * vec4f(position, 1.0);
    let place = clip.xy / clip.w * vec2f(0.5, -0.5) + 0.5;
    return min(vec2u(max(place, vec2f(0.0)) * vec2f(view.size)), view.size - 1u);
}

// Returns whether the pixel onto which a point falls shows the plane of the point. `side`: the geometric normal, on the
// side that sends light.
fn is_in_picture(position: vec3f, side: vec3f) -> bool {
    let from_camera = position - view.position;
    let depth = dot(from_camera, view.forward);
    let along = select(from_camera, view.forward, view.orthographic != 0u);
    let clip = view.clip_from_world * vec4f(position, 1.0);
    if (dot(side, along) >= 0.0 || depth <= 0.0 || max(abs(clip.x), abs(clip.y)) >= clip.w) {
        return false;
    }
    let pixel = pixel_in_picture(position);
    let seen = load_distance(pixel);
    let ray = pixel_ray(pixel);
    let width = 2.0 * length(view.right) / f32(view.size.x) * select(depth, 1.0, view.orthographic != 0u);
    let off_plane = dot(side, ray.origin + ray.direction * seen - position);
    return seen > 0.0 && abs(off_plane) <= SAME_PLANE * width;
}
