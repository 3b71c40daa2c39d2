// The surface that a pixel shows, found again from its triangle's number: what the path tracer's own ray would hit.
#import "scene/surface.wgsl"

@group(1) @binding(33) var visibility: texture_2d<u32>;  // triangle + 1, instance + 1

// Returns where a ray meets the plane of a triangle, brought inside the triangle: the coverage of rasterisation and the
// rounding of the ray differ at its edges.
fn hit_on_triangle(ray: Ray, t: Triangle, triangle: u32, instance: u32) -> Hit {
    var origin = ray.origin;
    var direction = ray.direction;
    if (HAS_INSTANCES && instance != NONE) {
        let local_from_world = instances[instance].local_from_world;
        origin = local_from_world * vec4f(origin, 1.0);
        direction = local_from_world * vec4f(direction, 0.0);
    }
    let p = cross(direction, t.edge2);
    let inverse = 1.0 / dot(t.edge1, p);
    let s = origin - t.v0;
    let q = cross(s, t.edge1);
    var weights = vec2f(dot(s, p), dot(direction, q)) * inverse;
    // A triangle seen edge-on has no such point: take its first corner. Written so that a NaN fails.
    weights = select(vec2f(0.0), clamp(weights, vec2f(0.0), vec2f(1.0)), abs(weights.x) + abs(weights.y) < 1e4);
    weights /= max(weights.x + weights.y, 1.0);
    let point = t.v0 + weights.x * t.edge1 + weights.y * t.edge2;
    let distance = dot(point - origin, direction) / dot(direction, direction);
    return Hit(max(distance, 0.0), triangle, select(instance, t.instance, t.instance != NONE), weights);
}

// Returns the triangle and the instance that a pixel shows; the triangle is NONE where there is nothing.
fn load_visibility(pixel: vec2u) -> vec2u {
    return textureLoad(visibility, pixel, 0).xy - 1u;
}
