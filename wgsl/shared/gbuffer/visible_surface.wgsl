// A pixel's surface from its triangle in the visibility buffer: the point that the path tracer's ray hits.
#import "scene/surface.wgsl"
#import "scene/ray_triangle.wgsl"

// A hit counts as none if its barycentric coordinates sum to this or more: beyond 1e4 triangle widths their rounding,
// 1e4 * 6e-8, is as large as the difference between the corners in a picture.
const FAR_OUTSIDE: f32 = 1e4;

@group(1) @binding(33) var visibility: texture_2d<u32>;  // triangle + 1, instance + 1

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
    var hit = Hit(0.0, triangle, select(instance, t.instance, t.instance != NONE), from_anchor);
    hit.distance = max(dot(hit_point(t, hit) - origin, direction) / dot(direction, direction), 0.0);
    return hit;
}

// The point of a hit in the world.
struct HitPoint {
    position: vec3f,
    terms: vec3f,     // of `ray_offset`
}

// Returns the point of a hit: on the triangle, where the ray may only pass by it.
fn point_of_hit(t: Triangle, hit: Hit) -> HitPoint {
    let point = hit_point(t, hit);
    let terms = hit_terms(t, hit);
    if (HAS_INSTANCES && t.instance == NONE) {
        let w = instances[hit.instance].world_from_local;
        return HitPoint(w * vec4f(point, 1.0), transformed_terms(w, max(terms, abs(point))));
    }
    return HitPoint(point, terms);
}

// Returns the triangle and the instance that a pixel shows; the triangle is NONE if the pixel shows no surface.
fn load_visibility(pixel: vec2u) -> vec2u {
    return textureLoad(visibility, pixel, 0).xy - 1u;
}
