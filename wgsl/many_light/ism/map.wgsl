// Imperfect shadow maps: the hemisphere over a VPL as a square, and what a texel of it says about the nearest surface.
//
// A texel is 32 bits: in the upper half a code of how near a surface is at its centre, 0 where there is nothing, and in
// a byte each by how many steps of SLOPE_STEP the code grows along x and y. So a plane is a plane, whatever its slope,
// and the nearest of several surfaces is the greatest number.
#import "scene/info.wgsl"
#import "many_light/vpl/table.wgsl"

override ISM_RESOLUTION: u32 = 64u;  // texels on a side of a map

// Codes of distances: 2048 to a doubling of the square, so 0.02 % of a distance each; 16 doublings of a distance, up to
// the scene's diameter.
const CODES_PER_OCTAVE: f32 = 2048.0;
// Codes per texel: at 64 texels a slope of 11 fits, and rounding is off by 0.05 % of the distance at a texel's corner.
const SLOPE_STEP: f32 = 16.0;

// Returns the code of the square of a distance, greater if it is nearer: at least 1 within the scene.
fn distance_code(squared: f32) -> f32 {
    let scale = 4.0 * scene.radius * scene.radius;
    return CODES_PER_OCTAVE * log2(scale / squared) + 1.0;
}

// Returns the place in the unit disc of a unit direction with z >= 0: every texel has the same solid angle (Lambert).
fn hemisphere_encode(v: vec3f) -> vec2f {
    return v.xy * inverseSqrt(1.0 + v.z);
}

// Returns a unit direction; beyond the disc, one below the horizon.
fn hemisphere_decode(place: vec2f) -> vec3f {
    let squared = dot(place, place);
    return vec3f(place * sqrt(2.0 - min(squared, 2.0)), 1.0 - squared);
}

// Returns the direction of the ray through a point of a map, in texels from its corner: from the horizon, where a
// light's own surface lies, and from beyond it, moved up by half a texel.
fn ray_direction(texel: vec2f) -> vec3f {
    let place = texel * (2.0 / f32(ISM_RESOLUTION)) - 1.0;
    let highest = 1.0 - 1.0 / f32(ISM_RESOLUTION);
    return hemisphere_decode(place * min(highest * inverseSqrt(max(dot(place, place), 1e-9)), 1.0));
}

// Returns the texel that such a ray goes through, of a point in the corners of texels.
fn ray_texel(texel: vec2u) -> vec2u {
    let place = (hemisphere_encode(ray_direction(vec2f(texel))) * 0.5 + 0.5) * f32(ISM_RESOLUTION);
    return min(vec2u(place), vec2u(ISM_RESOLUTION - 1u));
}

// Returns whether texels within `reach` of a point of a map see nothing of the hemisphere.
fn is_below_horizon(texel: vec2f, reach: f32) -> bool {
    let place = texel * (2.0 / f32(ISM_RESOLUTION)) - 1.0;
    let last = 1.0 + reach * (2.0 / f32(ISM_RESOLUTION));
    return dot(place, place) > last * last;
}

// Returns the direction in a map's own frame, unit, of a point on it, in texels from its corner.
fn map_direction(texel: vec2f) -> vec3f {
    return hemisphere_decode(texel * (2.0 / f32(ISM_RESOLUTION)) - 1.0);
}

// What a direction meets of a plane: 1 / distance, 0 for nothing; by what share of that it grows from a texel to the
// next along x and y.
struct Tangent {
    inverse: f32,
    grows: vec2f,
}

// Returns it for a unit direction w and the plane dot(m, x) = 1; m is 0 for nothing.
fn plane_tangent(w: vec3f, m: vec3f) -> Tangent {
    // From a place to the next, w grows by (s, 0, -2 x) - x place / s along x, and likewise along y, where
    // place = w.xy / s and s = sqrt(1 + w.z).
    let inverse = max(dot(m, w), 0.0);
    let rising = max(1.0 + w.z, 0.01);
    let r = inverseSqrt(rising);
    let grows = rising * r * m.xy - w.xy * (r * (dot(m.xy, w.xy) / rising + 2.0 * m.z));
    return Tangent(inverse, grows * (2.0 / f32(ISM_RESOLUTION) / max(inverse, 1e-30)));
}

// Returns a code of 16 bits and slopes of 8 each, given how much ln(1 / distance) grows from a texel to the next.
fn pack_texel(code: f32, grows: vec2f) -> u32 {
    const STEPS: f32 = 2.0 * CODES_PER_OCTAVE / 0.6931472 / SLOPE_STEP;
    let steps = vec2u(vec2i(clamp(round(grows * STEPS), vec2f(-127.0), vec2f(127.0)))) & vec2u(0xffu);
    return (u32(clamp(code + 0.5, 1.0, 65535.0)) << 16u) | (steps.x << 8u) | steps.y;
}

// Returns the texel for a unit direction w and a plane.
fn plane_texel(w: vec3f, m: vec3f) -> u32 {
    let tangent = plane_tangent(w, m);
    let t = 1.0 / max(tangent.inverse, 1e-30);
    return select(0u, pack_texel(distance_code(t * t), tangent.grows), tangent.inverse > 0.0);
}

// Texels on a side of the blocks in which surfaces are told from each other.
const BLOCK: u32 = 2u;

// Returns the texels of a block around a unit direction w for a plane: left and right of its upper row, of its lower one.
fn block_texels(w: vec3f, m: vec3f) -> vec4u {
    let tangent = plane_tangent(w, m);
    let half = 0.5 * tangent.grows;
    // 1 / distance is nearly linear, over that at the centre.
    let rises = max(
        1.0 + vec4f(-half.x - half.y, half.x - half.y, half.y - half.x, half.x + half.y), vec4f(0.1));
    let t = 1.0 / max(tangent.inverse, 1e-30);
    let codes = distance_code(t * t) + 2.0 * CODES_PER_OCTAVE * log2(rises);
    let texels = vec4u(
        pack_texel(codes.x, tangent.grows / rises.x), pack_texel(codes.y, tangent.grows / rises.y),
        pack_texel(codes.z, tangent.grows / rises.z), pack_texel(codes.w, tangent.grows / rises.w));
    return select(vec4u(0u), texels, tangent.inverse > 0.0);
}

// Returns the distance of a code.
fn code_distance(code: f32) -> f32 {
    return 2.0 * scene.radius * exp2((0.5 - 0.5 * code) / CODES_PER_OCTAVE);
}

// Returns the plane m of a texel in a unit direction w, at a distance t: the inverse of plane_texel.
fn texel_plane(w: vec3f, t: f32, slopes: vec2f) -> vec3f {
    // By how much ln dot(m, w) grows from a place to the next along x and y.
    const K: f32 = 2.0 * CODES_PER_OCTAVE / 0.6931472 / SLOPE_STEP;
    let grows = slopes * (f32(ISM_RESOLUTION) / (2.0 * K));
    // By how much w does; the area of both is 2.
    let s = sqrt(max(1.0 + w.z, 0.01));
    let x = w.xy / s;
    let along_x = vec3f(s - x.x * x.x / s, -x.x * x.y / s, -2.0 * x.x);
    let along_y = vec3f(-x.x * x.y / s, s - x.y * x.y / s, -2.0 * x.y);
    return (w + 0.5 * (grows.x * cross(along_y, w) + grows.y * cross(w, along_x))) / t;
}

// Returns by how many steps a texel's code grows along x and y.
fn texel_slopes(texel: u32) -> vec2f {
    return vec2f(vec2i(extractBits(i32(texel), 8u, 8u), extractBits(i32(texel), 0u, 8u)));
}

// Returns the code of a texel at an offset in texels from the texel's centre.
fn texel_code(texel: u32, offset: vec2f) -> f32 {
    return f32(texel >> 16u) + SLOPE_STEP * dot(texel_slopes(texel), offset);
}

// Returns the corner of a slot's map in an atlas that is so many texels wide.
fn map_corner(slot: u32, atlas_width: u32) -> vec2u {
    let columns = atlas_width / ISM_RESOLUTION;
    return vec2u(slot % columns, slot / columns) * ISM_RESOLUTION;
}
