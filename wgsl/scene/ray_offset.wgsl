// The origin of a ray that leaves a surface: offset along the geometric normal by more than the rounding error of the
// hit point.
//
// start = p +- n offset, offset = 32 u E, on the side that the ray leaves by. u = 2^-24 is the unit roundoff of
// float32; E, the extent, bounds the magnitude of all coordinates that p is computed from, in metres.
//
// Size: a hit is v0 + b1 edge1 + b2 edge2, five roundings; its instance's transform and the transform back for the next
// ray are nine more of at most u E each, for every coordinate. So p is off its plane by at most sqrt(3) 14 u E = 24 u
// E, and the next test's own difference origin - v0 adds sqrt(3) 2 u E = 3.5 u E. 32 u is the next power of two. A
// pixel's point, origin + direction * distance, takes fewer roundings. In a float32 replay of 2 million random
// triangles under random transforms the worst point was 3 u E off. Errs bright: blockers nearer than the offset, 1.9e-6
// E, are missed. Slivers amplify the test's rounding by the inverse of their sine and may shadow themselves.
//
// The normal must be geometric: a shading normal that leans away leaves by less, or through the surface.
#import "scene/info.wgsl"
#import "common/math.wgsl"

const OFFSET_PER_EXTENT: f32 = 32.0 * 5.9604645e-8;

// Shadow rays end at this share of their way, short of the emitter's own surface, whose point is rounded by about 2 u
// E, too: enough for lights farther than E / 800, over the cosine at the light. Errs bright: blockers within 0.01 % of
// the way before the light are missed.
const STOP_SHORT: f32 = 0.9999;

// Returns the offset of a point, metres.
fn ray_offset(extent: f32) -> f32 {
    return OFFSET_PER_EXTENT * extent;
}

// Returns the extent of any point on a surface of the scene, where its triangle is not at hand.
fn scene_extent() -> f32 {
    return max3(abs(scene.centre)) + scene.radius;
}

// Returns the offset of a point that a pixel shows, `distance_seen` metres from the camera, which may be outside the
// scene.
fn pixel_ray_offset(distance_seen: f32) -> f32 {
    return ray_offset(scene_extent() + distance_seen);
}

// Returns where a ray in `direction` starts, of any length. `normal` is geometric and unit, of either side.
fn offset_origin(position: vec3f, normal: vec3f, offset: f32, direction: vec3f) -> vec3f {
    return position + normal * select(-offset, offset, dot(direction, normal) > 0.0);
}
