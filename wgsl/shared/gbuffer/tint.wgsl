// One invocation finds the factor on a pixel's light: of the glass that the pixel shows, or shows through.
//
// In: visibility, distance, scene. Out: product of P / p of the see-through surfaces in front of the surface shown, times
// a / (1 - p) of that surface (`scene/see_through.wgsl`). Exact, but where rasterisation and rays differ along edges.
#import "shared/gbuffer/visible_surface.wgsl"
#import "shared/gbuffer/distance.wgsl"
#import "scene/trace.wgsl"

@group(1) @binding(11) var<storage, read_write> tint: array<vec4f>;

// Share of the distance to the surface shown that is in front of it: the rest is rounding.
const IN_FRONT: f32 = 1.0 - 4e-6;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (any(id.xy >= view.size)) {
        return;
    }
    let ray = pixel_ray(id.xy);
    let seen = load_visibility(id.xy);
    let is_seen = seen.x != NONE;
    var found = tint_of_passed(ray, select(FLOAT_MAX, load_distance(id.xy) * IN_FRONT, is_seen));
    if (is_seen) {
        let t = load_triangle(seen.x);
        if (is_see_through(t.material)) {
            found *= passage_of_hit(t, hit_on_triangle(ray, t, seen.x, seen.y), ray.direction, false).kept;
        }
    }
    tint[id.y * view.size.x + id.x] = vec4f(found, 1.0);
}
