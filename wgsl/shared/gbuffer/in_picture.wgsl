// Whether the picture shows a surface point: techniques of screen space find its light themselves.
#import "scene/info.wgsl"

@group(1) @binding(31) var distance: texture_2d<f32>;  // metres along the pixel's ray, 0: nothing there

// Points count as seen if the pixel's point lies within this number of pixel widths of their plane.
const SAME_PLANE: f32 = 1.0;

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
    let pixel = vec2u((clip.xy / clip.w * vec2f(0.5, -0.5) + 0.5) * vec2f(view.size));
    let seen = textureLoad(distance, min(pixel, view.size - 1u), 0).r;
    let ray = pixel_ray(pixel);
    let width = 2.0 * length(view.right) / f32(view.size.x) * select(depth, 1.0, view.orthographic != 0u);
    let off_plane = dot(side, ray.origin + ray.direction * seen - position);
    return seen > 0.0 && abs(off_plane) <= SAME_PLANE * width;
}
