// The triangle that a ray from a VPL hits, in the frame of the VPL's map.
//
// With the corners v0, v1, v2 relative to the VPL, a direction w meets the triangle's plane at the distance t, where
// t w = b0 v0 + b1 v1 + b2 v2 and b0 + b1 + b2 = 1. So b / t = inverse(v0 v1 v2) w is linear in w: w meets the triangle
// if no row of it is negative, and the sum of the rows is the plane m, dot(m, w) = 1 / t.
#import "scene/ray_offset.wgsl"
#import "scene/trace.wgsl"
#import "many_light/ism/map.wgsl"

struct HitTriangle {
    plane: vec3f,     // m, 1/m; 0 where the ray leaves the scene
    distance: f32,    // metres; 0 where the ray leaves the scene
    row0: vec3f,      // barycentric weights over t, 1/m
    row1: vec3f,
    width: f32,       // its least width over the distance, foreshortened; 0 for a piece of a sphere
}

// Largest relative difference between the distances to the triangle's plane and along the ray. A larger difference
// means a triangle seen edge-on, or one that the ray missed by rounding. tools/README.md, "Constants".
const PLANE_TOLERANCE: f32 = 1e-2;

// Returns the triangle that a ray of a VPL hits; `local` is the ray's unit direction in the frame of the map.
fn trace_triangle(vpl: Vpl, frame: mat3x3f, local: vec3f) -> HitTriangle {
    let start = vpl.position + vpl.normal * ray_offset(vpl.normal, surface_terms(vpl.position));
    let hit = trace(Ray(start, frame * local), FLOAT_MAX);
    let far = hit.distance;
    if (hit.triangle == NONE) {
        return HitTriangle(vec3f(0.0), 0.0, vec3f(0.0), vec3f(0.0), 0.0);
    }
    // Load the triangle in the world's frame.
    let t = load_triangle(hit.triangle);
    var v0 = first_corner(t);
    var edge1 = t.edge1;
    var edge2 = t.edge2;
    if (HAS_INSTANCES && t.instance == NONE) {
        let w = instances[hit.instance].world_from_local;
        v0 = w * vec4f(v0, 1.0);
        edge1 = w * vec4f(edge1, 0.0);
        edge2 = w * vec4f(edge2, 0.0);
    }
    // Transform to the map's frame, in units of the ray's length, so that products of three coordinates stay in range.
    let scale = 1.0 / far;
    v0 = ((v0 - vpl.position) * scale) * frame;
    let v1 = v0 + (edge1 * scale) * frame;
    let v2 = v0 + (edge2 * scale) * frame;
    let volume = dot(v0, cross(v1, v2));
    let normal = cross(v1 - v0, v2 - v0);
    // The triangle's least width is its height over the longest side.
    let longest = sqrt(max(dot(v1 - v0, v1 - v0), max(dot(v2 - v0, v2 - v0), dot(v2 - v1, v2 - v1))));
    let cosine = abs(dot(normal, local)) / max(length(normal), 1e-30);
    let width = length(normal) / max(longest, 1e-30) * cosine;
    // Invert the matrix of its corners. It is singular if the triangle lies in a plane with the VPL: then no direction
    // near the ray meets the triangle.
    let is_regular = abs(volume) >= 1e-37;
    let inverse = select(0.0, 1.0 / volume, is_regular);
    let m = normal * inverse;
    let row0 = select(-local, cross(v1, v2) * inverse, is_regular);
    let row1 = select(-local, cross(v2, v0) * inverse, is_regular);
    // A piece of a sphere around the VPL replaces a triangle whose plane the ray does not meet.
    let is_met = abs(dot(m, local) - 1.0) < PLANE_TOLERANCE;
    return HitTriangle(
        select(local, m, is_met) * scale, far, row0 * scale, row1 * scale, select(0.0, width, is_met));
}
