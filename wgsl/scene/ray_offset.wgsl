// The origin of a ray that leaves a surface: offset along the geometric normal by more than the rounding error of the
// hit point.
//
// start = p +- n offset, offset = 32 u E, on the ray's side of the surface. u = 2^-24 is the unit roundoff of float32;
// E, the extent, bounds the magnitude of all coordinates that p is computed from, in metres.
//
// Size: a hit is v0 + b1 edge1 + b2 edge2, five roundings; its instance's transform and the inverse transform for the
// next ray add nine more, at most u E each per coordinate. So p is off its plane by at most sqrt(3) 14 u E = 24 u E,
// and the next test's own difference origin - v0 adds sqrt(3) 2 u E = 3.5 u E. 32 u is the next power of two. A pixel's
// point, origin + direction * distance, takes fewer roundings. The worst of 2 million random triangles under random
// transforms was 3 u E off in a float32 replay. Errs bright: rays miss blockers nearer than the offset, 1.9e-6 E.
// Slivers amplify the test's rounding by the inverse of their sine and may shadow themselves.
//
// The normal must be geometric: an offset along a tilted shading normal clears the surface by less, or goes through it.
#import "scene/info.wgsl"
#import "common/math.wgsl"

const OFFSET_PER_EXTENT: f32 = 32.0 * 5.9604645e-8;

// Shadow rays end at this share of their length, short of the emitter's own surface, whose point is rounded by about 2
// u E. This suffices for lights farther than E / 800 over the cosine at the light. Errs bright: rays miss blockers in
// the last 0.01 % of their length.
const STOP_SHORT: f32 = 0.9999;

// Returns the offset of a point, metres.
fn ray_offset(extent: f32) -> f32 {
    return OFFSET_PER_EXTENT * extent;
}

// Returns an extent valid for all surface points of the scene, for callers without the triangle.
fn scene_extent() -> f32 {
    return max3(abs(scene.centre)) + scene.radius;
}

// Returns the offset of a pixel's surface point, `distance_seen` metres from the camera; the camera may be outside the
// scene.
fn pixel_ray_offset(distance_seen: f32) -> f32 {
    return ray_offset(scene_extent() + distance_seen);
}

// Returns the origin of a ray in `direction` (any length). `normal`: geometric, unit, on either side.
fn offset_origin(position: vec3f, normal: vec3f, offset: f32, direction: vec3f) -> vec3f {
    return position + normal * select(-offset, offset, dot(direction, normal) > 0.0);
}
