// The hit of a ray with a known triangle.
#import "scene/ray_triangle.wgsl"

// A hit counts as none if its barycentric coordinates sum to this or more: beyond 1e4 triangle widths their rounding,
// 1e4 * 6e-8, is as large as the difference between the corners in a picture.
const FAR_OUTSIDE: f32 = 1e4;

// Returns a ray's hit with the plane of a triangle, clamped to the triangle as `is_in_triangle` sees it: rasterisation
// and rays round differently at its edges.
fn hit_on_triangle(ray: Ray, t: Triangle, triangle: u32, instance: u32) -> Hit {
    var origin = ray.origin;
    var direction = ray.direction;
    if (HAS_INSTANCES && instance != NONE) {
        let local_from_world = instances[instance].local_from_world;
        origin = local_from_world * vec4f(origin, 1.0);
        direction = local_from_world * vec4f(direction, 0.0);
    }
    let h = hit_plane(origin, direction, t);
    // A triangle seen edge-on has no hit, or one far outside: use its first corner.
    let is_near = h.exists && abs(h.from_anchor.x) + abs(h.from_anchor.y) < FAR_OUTSIDE;
    let anchor = anchor_weights(t);
    var from_anchor = select(-anchor, clamp(h.from_anchor, -anchor - EDGE, 1.0 - anchor + EDGE), is_near);
    let sum = anchor.x + anchor.y + from_anchor.x + from_anchor.y;
    if (sum > 1.0 + EDGE) {
        from_anchor = (anchor + from_anchor) / sum - anchor;
    }
    var hit = Hit(0.0, triangle, select(instance, t.instance, t.instance != NONE), from_anchor, UNTINTED);
    hit.distance = max(dot(hit_point(t, hit) - origin, direction) / dot(direction, direction), 0.0);
    return hit;
}
