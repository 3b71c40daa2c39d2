// The guide of edge-aware filters: each pixel's depth and normal in the camera's frame, and the distance of other
// pixels from its tangent plane.
//
// Depth here is linear over the picture on a plane: 1 / view depth in perspective, view depth if orthographic; 0 where
// there is nothing to light.
#import "scene/info.wgsl"

// Returns the depth of a point at a distance along a pixel's ray.
fn plane_depth(ray: Ray, seen: f32) -> f32 {
    let along = seen * dot(ray.direction, view.forward);
    return select(1.0 / max(along, 1e-37), along, view.orthographic != 0u);
}

// Returns a direction of the world in the camera's frame.
fn to_view(direction: vec3f) -> vec3f {
    return vec3f(
        dot(direction, view.right) / length(view.right), dot(direction, view.up) / length(view.up),
        dot(direction, view.forward));
}

// Packs a unit normal of the world, 10 bits for each coordinate in the camera's frame.
fn pack_view_normal(normal: vec3f) -> u32 {
    let in_view = to_view(normal);
    let code = bitcast<vec3u>(vec3i(round(clamp(in_view, vec3f(-1.0), vec3f(1.0)) * 511.0))) & vec3u(1023u);
    return code.x | (code.y << 10u) | (code.z << 20u);
}

// Returns the normal, of length 1 up to 0.2 %.
fn unpack_view_normal(code: u32) -> vec3f {
    return vec3f(bitcast<vec3i>(vec3u(code << 22u, code << 12u, code << 2u)) >> vec3u(22u)) * (1.0 / 511.0);
}

// The tangent plane of a pixel. A pixel (x, y) away lies at + across . (x, y) - factor * depth off the plane, in pixel
// widths at that pixel's depth.
struct Plane {
    factor: f32,
    at: f32,
    across: vec2f,
}

fn tangent_plane(pixel: vec2u, depth: f32, view_normal: vec3f) -> Plane {
    let size = vec2f(view.whole);
    let half = vec2f(length(view.right), length(view.up));
    let width = 2.0 * half.x / size.x;
    // Change along the normal, per pixel, of a ray of unit view depth, or of a parallel ray's origin.
    let across = view_normal.xy * vec2f(1.0, -half.y * size.x / (half.x * size.y));
    let ndc = (vec2f(whole_pixel(pixel)) + view.offset) / size * vec2f(2.0, -2.0) + vec2f(-1.0, 1.0);
    let facing = dot(view_normal, vec3f(ndc * half, 1.0)) / width;
    let along = view_normal.z / width;
    let parallel = view.orthographic != 0u;
    return Plane(
        select(facing / max(depth, 1e-37), along, parallel), select(facing, along * depth, parallel),
        select(across, -across, parallel));
}
