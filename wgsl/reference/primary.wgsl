// One invocation finds the surface at the centre of one pixel, by a camera ray. See-through surfaces count as there if
// they let pass at most half of the light.
//
// Out: albedo (base colour) and, in a, 1 where something is seen; shading normal facing the viewer and, in a, the
// distance along the ray in metres (0: nothing there); position in metres relative to the scene's origin and, in a, the
// number of the instance, from 1. Rows from the top.
#import "scene/surface.wgsl"
#import "scene/trace.wgsl"

@group(1) @binding(11) var<storage, read_write> albedo: array<vec4f>;
@group(1) @binding(12) var<storage, read_write> normal: array<vec4f>;
@group(1) @binding(13) var<storage, read_write> position: array<vec4f>;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let pixel = id.xy;
    if (any(pixel >= view.size)) {
        return;
    }
    let index = pixel.y * view.size.x + pixel.x;
    let ray = camera_ray(vec2f(whole_pixel(pixel)) + 0.5);
    let hit = trace_firm(ray, FLOAT_MAX);
    if (hit.triangle == NONE) {
        albedo[index] = vec4f(0.0);
        normal[index] = vec4f(0.0);
        position[index] = vec4f(0.0);
        return;
    }
    let surface = surface_at(hit, ray.direction);
    albedo[index] = vec4f(surface.base_color, 1.0);
    normal[index] = vec4f(surface.normal, hit.distance);
    position[index] = vec4f(surface.position, f32(hit.instance + 1u));
}
