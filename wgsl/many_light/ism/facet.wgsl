// The triangle that a ray from a VPL hits, as the VPL's map sees it.
//
// With the corners v0, v1, v2 relative to the VPL, a direction w meets the triangle's plane at t where
// t w = b0 v0 + b1 v1 + b2 v2 and b0 + b1 + b2 = 1. So b / t = inverse(v0 v1 v2) w is linear in w: its rows tell
// whether w meets the triangle (none is negative), their sum m tells where, dot(m, w) = 1 / t.
#import "scene/trace.wgsl"
#import "many_light/ism/map.wgsl"

struct Facet {
    plane: vec3f,     // m, in the frame of the map; 0 where the ray leaves the scene
    distance: f32,    // metres, 0 where the ray leaves the scene
    row0: vec3f,
    row1: vec3f,
    width: f32,       // its least one over the distance, as seen; 0 for what is no plane
}

// Metres along the VPL's normal that a ray starts above its surface, over the scene's radius: above the rounding of
// positions. Chosen.
const LEAVE: f32 = 1e-5;

// Returns what a ray of the VPL hits; `local` is its unit direction in the frame of the map.
fn trace_facet(vpl: Vpl, frame: mat3x3f, local: vec3f) -> Facet {
    let hit = trace(Ray(vpl.position + vpl.normal * (LEAVE * scene.radius), frame * local), FLOAT_MAX);
    let far = hit.distance;
    if (hit.triangle == NONE) {
        return Facet(vec3f(0.0), 0.0, vec3f(0.0), vec3f(0.0), 0.0);
    }
    let t = load_triangle(hit.triangle);
    var v0 = t.v0;
    var edge1 = t.edge1;
    var edge2 = t.edge2;
    if (HAS_INSTANCES && t.instance == NONE) {
        let w = instances[hit.instance].world_from_local;
        v0 = w * vec4f(v0, 1.0);
        edge1 = w * vec4f(edge1, 0.0);
        edge2 = w * vec4f(edge2, 0.0);
    }
    // In lengths of the ray, so that products stay in range.
    let scale = 1.0 / far;
    v0 = ((v0 - vpl.position) * scale) * frame;
    let v1 = v0 + (edge1 * scale) * frame;
    let v2 = v0 + (edge2 * scale) * frame;
    let volume = dot(v0, cross(v1, v2));
    let normal = cross(v1 - v0, v2 - v0);
    let longest = sqrt(max(dot(v1 - v0, v1 - v0), max(dot(v2 - v0, v2 - v0), dot(v2 - v1, v2 - v1))));
    let cosine = abs(dot(normal, local)) / max(length(normal), 1e-30);
    let width = length(normal) / max(longest, 1e-30) * cosine;
    // A triangle seen edge-on, or one that the ray's own rounding missed, is a piece of a sphere.
    let inverse = 1.0 / volume;
    let m = cross(v1 - v0, v2 - v0) * inverse;
    let flat = abs(dot(m, local) - 1.0) < 1e-2;
    return Facet(
        select(local, m, flat) * scale, far, cross(v1, v2) * inverse * scale, cross(v2, v0) * inverse * scale,
        select(0.0, width, flat));
}
