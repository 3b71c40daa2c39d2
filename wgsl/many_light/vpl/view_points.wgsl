// One invocation picks a pixel and keeps the surface that it shows, for estimates of what light the view needs.
#import "shared/gbuffer/load.wgsl"
#import "common/random.wgsl"

struct ViewPoint {
    position: vec3f,
    is_seen: f32,   // 1, or 0 where the pixel shows no surface
    normal: vec3f,
    pad: f32,
}

@group(1) @binding(11) var<storage, read_write> view_points: array<ViewPoint>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (id.x >= arrayLength(&view_points)) {
        return;
    }
    let pixel = min(vec2u(sobol_2d(id.x, 0u) * vec2f(view.size)), view.size - 1u);
    let distance_seen = load_distance(pixel);
    let s = load_surface(pixel);
    let ray = pixel_ray(pixel);
    let is_lit = distance_seen > 0.0 && (s.flags & GBUFFER_UNLIT) == 0u;
    view_points[id.x] = ViewPoint(
        ray.origin + ray.direction * distance_seen, select(0.0, 1.0, is_lit), select(vec3f(0.0), s.normal, is_lit), 0.0);
}
