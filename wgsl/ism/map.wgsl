// Imperfect shadow maps: the hemisphere over a VPL as a square, and what a texel of it says about the nearest surface.
//
// A texel is 32 bits: in the upper half a code of how near a surface is at its centre, 0 where there is nothing, and in
// a byte each by how many steps of SLOPE_STEP the code grows along x and y. So a plane is a plane, whatever its slope,
// and the nearest of several surfaces is the greatest number.
#import "scene/info.wgsl"
#import "vpl/table.wgsl"

override ISM_RESOLUTION: u32 = 64u;  // texels on a side of a map
override ISM_COLUMNS: u32 = 32u;     // maps side by side in the atlas

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

// Returns the texel for a unit direction w and the plane dot(m, x) = 1; m is 0 for nothing.
fn plane_texel(w: vec3f, m: vec3f) -> u32 {
    // The code is a constant and K ln dot(m, w). From a place to the next, w grows by
    // (s, 0, -2 x) - x place / s along x, and likewise along y, where place = w.xy / s and s = sqrt(1 + w.z).
    const K: f32 = 2.0 * CODES_PER_OCTAVE / 0.6931472 / SLOPE_STEP;
    let inverse = max(dot(m, w), 0.0);
    let t = 1.0 / max(inverse, 1e-30);
    let rising = max(1.0 + w.z, 0.01);
    let r = inverseSqrt(rising);
    let grows = rising * r * m.xy - w.xy * (r * (dot(m.xy, w.xy) / rising + 2.0 * m.z));
    let slope = clamp(round((2.0 * K / f32(ISM_RESOLUTION)) * t * grows), vec2f(-127.0), vec2f(127.0));
    let steps = vec2u(vec2i(slope)) & vec2u(0xffu);
    let code = u32(clamp(distance_code(t * t) + 0.5, 1.0, 65535.0));
    return select(0u, (code << 16u) | (steps.x << 8u) | steps.y, inverse > 0.0);
}

// Returns by how many steps a texel's code grows along x and y.
fn texel_slopes(texel: u32) -> vec2f {
    return vec2f(vec2i(extractBits(i32(texel), 8u, 8u), extractBits(i32(texel), 0u, 8u)));
}

// Returns the code of a texel at an offset in texels from the texel's centre.
fn texel_code(texel: u32, offset: vec2f) -> f32 {
    return f32(texel >> 16u) + SLOPE_STEP * dot(texel_slopes(texel), offset);
}

// Returns the corner of a slot's map in the atlas, texels.
fn map_corner(slot: u32) -> vec2u {
    return vec2u(slot % ISM_COLUMNS, slot / ISM_COLUMNS) * ISM_RESOLUTION;
}
