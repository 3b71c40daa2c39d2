// One invocation finds the triangle at the centre of one pixel, as `reference/primary.wgsl` does, and the point on it.
//
// Out: the triangle's entries of the table of vertices, and the number of the instance, from 1 (0: nothing there); in the
// next element the barycentric weights of the second and third corner, as bits of floats.
#import "scene/trace.wgsl"

@group(1) @binding(11) var<storage, read_write> corners: array<vec4u>;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let pixel = id.xy;
    if (any(pixel >= view.size)) {
        return;
    }
    let index = 2u * (pixel.y * view.size.x + pixel.x);
    let hit = trace_firm(camera_ray(vec2f(whole_pixel(pixel)) + 0.5), FLOAT_MAX);
    if (hit.triangle == NONE) {
        corners[index] = vec4u(0u);
        corners[index + 1u] = vec4u(0u);
        return;
    }
    let t = load_triangle(hit.triangle);
    corners[index] = vec4u(t.corners, hit.instance + 1u);
    corners[index + 1u] = vec4u(bitcast<vec2u>(hit_weights(t, hit)), 0u, 0u);
}
