// One invocation computes a pixel's motion vector from the previous frame's camera, transforms and vertices.
//
// In: visibility, distance, transforms, previous positions of deformed meshes. Out: x, y the surface's motion over the
// picture since the previous frame, pixels, right and down; z its distance along the previous camera's ray, metres; w 1
// if it was in front of it, else 0. The sky moves by the camera's rotation only; its z is 0.
#import "shared/gbuffer/visible_surface.wgsl"

@group(0) @binding(2) var<uniform> view_before: View;
@group(1) @binding(11) var<storage, read_write> motion: array<vec4f>;
@group(1) @binding(12) var<storage, read> before_from_now: array<Motion>;  // by instance
@group(1) @binding(13) var<storage, read> before_positions: array<vec4f>;  // of deformed meshes, local
@group(1) @binding(31) var distance: texture_2d<f32>;

struct Motion {
    transform: mat4x3f,  // from current to previous world positions; of a deformed mesh, from previous local ones
    first_vertex: u32,   // vertex that `before_positions` begins with for this mesh; NONE: it is not deformed
}

override HAS_DEFORMATION: bool = true;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let pixel = id.xy;
    if (any(pixel >= view.size)) {
        return;
    }
    let index = pixel.y * view.size.x + pixel.x;
    let ray = pixel_ray(pixel);
    let seen = load_visibility(pixel);
    let is_seen = seen.x != NONE;
    var position = ray.origin + ray.direction * textureLoad(distance, pixel, 0).r;
    if (is_seen) {
        let t = load_triangle(seen.x);
        let instance = select(t.instance, seen.y, t.instance == NONE);
        let first = before_from_now[instance].first_vertex;
        if (HAS_DEFORMATION && first != NONE) {
            // The same point of the triangle.
            let weights = hit_weights(t, hit_on_triangle(ray, t, seen.x, seen.y));
            let corners = t.corners - first;
            position = (1.0 - weights.x - weights.y) * before_positions[corners.x].xyz
                + weights.x * before_positions[corners.y].xyz + weights.y * before_positions[corners.z].xyz;
        }
        position = before_from_now[instance].transform * vec4f(position, 1.0);
    }
    // The sky is a direction: infinitely far, it has no parallax.
    let point = select(vec4f(ray.direction, 0.0), vec4f(position, 1.0), is_seen);
    let clip = view_before.clip_from_world * point;
    if (clip.w <= 0.0) {
        motion[index] = vec4f(0.0);
        return;
    }
    // Subtract the jitter of both frames; motion is the surface's alone.
    let place = (clip.xy / clip.w * vec2f(0.5, -0.5) + 0.5) * vec2f(view_before.whole) - 0.5 + view_before.offset;
    let moved = vec2f(whole_pixel(pixel)) + view.offset - place;
    let from_camera = position - view_before.position;
    let along_ray = select(
        length(from_camera), dot(from_camera, view_before.forward), view_before.orthographic != 0u);
    motion[index] = vec4f(moved, select(0.0, along_ray, is_seen), 1.0);
}
