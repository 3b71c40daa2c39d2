// Whether the camera sees a surface point, for `path.visible_only`: screen-space techniques find light only from such
// points.
#import "scene/surface.wgsl"
#import "scene/trace.wgsl"

struct CameraVisibility {
    by_camera: bool,
    steps: u32,       // nodes visited and triangles tested
}

// Returns whether the camera sees a surface on the side that faces against `direction`.
fn is_seen_by_camera(s: Surface, direction: vec3f) -> CameraVisibility {
    let clip = view.clip_from_world * vec4f(s.position, 1.0);
    let depth = dot(s.position - view.position, view.forward);
    let to_eye = select(view.position - s.position, -view.forward * depth, view.orthographic != 0u);
    let same_side = dot(s.geometric_normal, to_eye) * dot(s.geometric_normal, direction) < 0.0;
    if (!same_side || depth <= 0.0 || max(abs(clip.x), abs(clip.y)) > clip.w) {
        return CameraVisibility(false, 0u);
    }
    let origin = leave_surface(s, to_eye);
    let way = Ray(origin, to_eye - (origin - s.position));
    let found = trace_shadow(way, 1.0);
    return CameraVisibility(!found.occluded_a, found.steps);
}
