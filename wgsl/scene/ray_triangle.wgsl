// The ray-triangle test (Moeller and Trumbore 1997, "Fast, Minimum Storage Ray/Triangle Intersection").
#import "scene/geometry.wgsl"
#import "common/math.wgsl"

// The hit of a ray with a triangle's plane.
struct PlaneHit {
    distance: f32,       // in lengths of the ray's direction
    from_anchor: vec2f,  // as `Hit`
    exists: bool,        // false: the ray is parallel to the plane, or the triangle has no area
}

// The determinant is tested explicitly: WGSL may assume that NaN does not occur, so comparisons may fail to reject it.
fn hit_plane(origin: vec3f, direction: vec3f, t: Triangle) -> PlaneHit {
    let p = cross(direction, t.edge2);
    let determinant = dot(t.edge1, p);
    // Below the smallest normal number the inverse overflows.
    let exists = abs(determinant) >= SMALLEST_NORMAL;
    let inverse = 1.0 / determinant;
    let s = origin - t.anchor;
    let q = cross(s, t.edge1);
    return PlaneHit(dot(t.edge2, q) * inverse, vec2f(dot(s, p), dot(direction, q)) * inverse, exists);
}

// Weights count as inside down to this below 0: neighbours round their shared edge differently, by 10 units of 2^-24
// where the ray starts a triangle's width away, and rays would pass between them.
const EDGE: f32 = 1e-6;

// Returns whether the ray meets the triangle itself, nearer than `limit`. Edges count as inside.
fn is_in_triangle(h: PlaneHit, t: Triangle, limit: f32) -> bool {
    let weights = anchor_weights(t) + h.from_anchor;
    let least = min(min(weights.x, weights.y), 1.0 - weights.x - weights.y);
    return least >= -EDGE && h.distance > 0.0 && h.distance < limit;
}
