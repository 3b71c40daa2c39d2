// The ray-triangle test (Moeller and Trumbore 1997, "Fast, Minimum Storage Ray/Triangle Intersection").
#import "scene/geometry.wgsl"
#import "common/math.wgsl"

// The hit of a ray with a triangle's plane.
struct PlaneHit {
    distance: f32,       // in lengths of the ray's direction
    barycentric: vec2f,  // weights of the second and third corner
    exists: bool,        // false: the ray is parallel to the plane, or the triangle has no area
}

// The determinant is tested explicitly: WGSL may assume that NaN does not occur, so comparisons may fail to reject it.
fn hit_plane(origin: vec3f, direction: vec3f, t: Triangle) -> PlaneHit {
    let p = cross(direction, t.edge2);
    let determinant = dot(t.edge1, p);
    // Below the smallest normal number the inverse overflows.
    let exists = abs(determinant) >= SMALLEST_NORMAL;
    let inverse = 1.0 / determinant;
    let s = origin - t.v0;
    let q = cross(s, t.edge1);
    return PlaneHit(dot(t.edge2, q) * inverse, vec2f(dot(s, p), dot(direction, q)) * inverse, exists);
}

// Returns whether the ray meets the triangle itself, nearer than `limit`. Edges count as inside.
fn is_in_triangle(h: PlaneHit, limit: f32) -> bool {
    let u = h.barycentric.x;
    let v = h.barycentric.y;
    return u >= 0.0 && v >= 0.0 && u + v <= 1.0 && h.distance > 0.0 && h.distance < limit;
}
