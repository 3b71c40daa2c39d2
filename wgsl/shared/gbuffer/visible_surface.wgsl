// A pixel's surface from its triangle in the visibility buffer: the point that the path tracer's ray hits.
#import "scene/surface.wgsl"
#import "scene/hit_on_triangle.wgsl"

@group(1) @binding(33) var visibility: texture_2d<u32>;  // triangle + 1, instance + 1

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

// Returns the triangle and the instance that a pixel shows; the triangle is NONE if the pixel shows no surface. The
// buffer is that of the whole picture.
fn load_visibility(pixel: vec2u) -> vec2u {
    return textureLoad(visibility, whole_pixel(pixel), 0).xy - 1u;
}
