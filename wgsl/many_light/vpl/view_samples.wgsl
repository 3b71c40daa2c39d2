// One invocation picks a pixel by a low-discrepancy sequence and stores the surface that it shows.
//
// In: G-buffer. Out: `view_samples`, metres. Exact; small objects may get no sample.
#import "many_light/vpl/view_sample.wgsl"
#import "shared/gbuffer/load.wgsl"
#import "common/random.wgsl"

@group(1) @binding(11) var<storage, read_write> view_samples: array<ViewSample>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (id.x >= arrayLength(&view_samples)) {
        return;
    }
    let pixel = min(vec2u(sobol_2d(id.x, 0u) * vec2f(view.size)), view.size - 1u);
    let distance_seen = load_distance(pixel);
    let s = load_surface(pixel);
    let ray = pixel_ray(pixel);
    let is_lit = distance_seen > 0.0 && (s.flags & GBUFFER_UNLIT) == 0u;
    view_samples[id.x] = ViewSample(
        ray.origin + ray.direction * distance_seen, select(0.0, 1.0, is_lit), select(vec3f(0.0), s.normal, is_lit),
        0.0);
}
