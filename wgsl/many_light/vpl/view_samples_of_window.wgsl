// One invocation picks a pixel of the whole picture as `view_samples.wgsl` does, and resolves its surface: the G-buffer of
// a window does not have it.
//
// In: visibility of these pixels, scene. Out: `view_samples`, metres, those of the whole picture. Exact.
#import "many_light/vpl/view_sample.wgsl"
#import "shared/gbuffer/surface.wgsl"
#import "shared/gbuffer/visible_surface.wgsl"
#import "common/random.wgsl"

@group(1) @binding(11) var<storage, read_write> view_samples: array<ViewSample>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (id.x >= arrayLength(&view_samples)) {
        return;
    }
    let pixel = min(vec2u(sobol_2d(id.x, 0u) * vec2f(view.whole)), view.whole - 1u);
    let seen = textureLoad(visibility, pixel, 0).xy - 1u;
    let ray = camera_ray(vec2f(pixel) + view.offset);
    view_samples[id.x] = ViewSample(ray.origin, 0.0, vec3f(0.0), 0.0);
    if (seen.x == NONE) {
        return;
    }
    // Resolve and round it as the G-buffer does.
    let triangle = load_triangle(seen.x);
    let hit = hit_on_triangle(ray, triangle, seen.x, seen.y);
    let s = surface_over(triangle, hit, ray.direction, pixel_footprint(ray, triangle, hit));
    let normal = octahedral_decode(unpack2x16snorm(pack2x16snorm(octahedral_encode(s.normal))));
    let is_lit = (s.flags & UNLIT) == 0u;
    view_samples[id.x] = ViewSample(
        ray.origin + ray.direction * max(hit.distance, 1e-37), select(0.0, 1.0, is_lit),
        select(vec3f(0.0), normal, is_lit), 0.0);
}
