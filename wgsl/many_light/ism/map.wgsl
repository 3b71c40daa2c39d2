// Imperfect shadow maps: the parameterisation of the hemisphere over a VPL, and the code of a texel.
//
// Parameterisation: Lambert's azimuthal equal-area projection in the square, so every texel has the same solid angle.
// Texel: the plane of the nearest surface in 32 bits. The upper half codes its nearness at the texel's centre (log2 of
// the squared distance, 0 for no surface); two bytes hold the slopes of that code along x and y. A texel thus stores a
// plane exactly but for rounding, and atomicMax keeps the nearest of several surfaces.
#import "scene/info.wgsl"
#import "many_light/vpl/table.wgsl"

override ISM_RESOLUTION: u32 = 64u;  // texels on a side of a map

// Angle of a texel's side, radians, times ISM_RESOLUTION: sqrt(8) = 2.83 by area, from 2 to 4 at the horizon by
// direction. Smaller values make splats and pull-push reach farther. tools/README.md, "Constants".
const TEXEL_ANGLE: f32 = 2.5;

// Codes per doubling of a squared distance: 65535 codes span 16 doublings of the distance, up to the scene's diameter,
// in steps of 0.02 %.
const CODES_PER_OCTAVE: f32 = 2048.0;
// Codes per step of a slope: a byte holds slopes up to 11 at a resolution of 64, and half a step is 0.05 % of the
// distance at a texel's corner.
const SLOPE_STEP: f32 = 16.0;

// Returns the code of a squared distance, m2: greater if nearer, at least 1 within the scene.
fn distance_code(squared: f32) -> f32 {
    let scale = 4.0 * scene.radius * scene.radius;
    return CODES_PER_OCTAVE * log2(scale / squared) + 1.0;
}

// Returns the place in the unit disc of a unit direction with z >= 0 (Lambert's equal-area projection).
fn hemisphere_encode(v: vec3f) -> vec2f {
    return v.xy * inverseSqrt(1.0 + v.z);
}

// Returns the unit direction of a place: below the horizon outside of the unit disc.
fn hemisphere_decode(place: vec2f) -> vec3f {
    let squared = dot(place, place);
    return vec3f(place * sqrt(2.0 - min(squared, 2.0)), 1.0 - squared);
}

// Returns the direction of the ray through a point of a map, in texels from its corner. Points lower than half a texel
// above the horizon, where the VPL's own surface lies, are moved up to that height.
fn ray_direction(texel: vec2f) -> vec3f {
    let place = texel * (2.0 / f32(ISM_RESOLUTION)) - 1.0;
    let highest = 1.0 - 1.0 / f32(ISM_RESOLUTION);
    return hemisphere_decode(place * min(highest * inverseSqrt(max(dot(place, place), 1e-9)), 1.0));
}

// Returns the texel that holds the ray through a texel's corner.
fn ray_texel(texel: vec2u) -> vec2u {
    let place = (hemisphere_encode(ray_direction(vec2f(texel))) * 0.5 + 0.5) * f32(ISM_RESOLUTION);
    return min(vec2u(place), vec2u(ISM_RESOLUTION - 1u));
}

// Returns whether all texels within `reach` texels of a point of a map lie below the horizon.
fn is_below_horizon(texel: vec2f, reach: f32) -> bool {
    let place = texel * (2.0 / f32(ISM_RESOLUTION)) - 1.0;
    let last = 1.0 + reach * (2.0 / f32(ISM_RESOLUTION));
    return dot(place, place) > last * last;
}

// Returns the unit direction, in the map's frame, of a point of a map, in texels from its corner.
fn map_direction(texel: vec2f) -> vec3f {
    return hemisphere_decode(texel * (2.0 / f32(ISM_RESOLUTION)) - 1.0);
}

// The nearness of a plane in a direction and its relative slopes: d ln(nearness) / d texel along x and y.
struct Nearness {
    inverse: f32,   // 1 / distance, 1/m; 0: the direction does not meet the plane
    slopes: vec2f,
}

// Returns the nearness of the plane dot(m, x) = 1 in a unit direction w. m = 0 means no surface.
fn plane_nearness(w: vec3f, m: vec3f) -> Nearness {
    // With (x, y) = w.xy / s and s = sqrt(1 + w.z): dw/dx = (s, 0, -2 x) - x (x, y, 0) / s, and the same along y.
    let inverse = max(dot(m, w), 0.0);
    let rising = max(1.0 + w.z, 0.01);
    let r = inverseSqrt(rising);
    let slopes = rising * r * m.xy - w.xy * (r * (dot(m.xy, w.xy) / rising + 2.0 * m.z));
    return Nearness(inverse, slopes * (2.0 / f32(ISM_RESOLUTION) / max(inverse, 1e-30)));
}

// Returns a texel: 16 bits of code and 8 for each slope, d ln(1 / distance) / d texel.
fn pack_texel(code: f32, slopes: vec2f) -> u32 {
    const STEPS: f32 = 2.0 * CODES_PER_OCTAVE / 0.6931472 / SLOPE_STEP;
    let steps = vec2u(vec2i(clamp(round(slopes * STEPS), vec2f(-127.0), vec2f(127.0)))) & vec2u(0xffu);
    return (u32(clamp(code + 0.5, 1.0, 65535.0)) << 16u) | (steps.x << 8u) | steps.y;
}

// Returns the texel of the plane m in a unit direction w.
fn plane_texel(w: vec3f, m: vec3f) -> u32 {
    let near = plane_nearness(w, m);
    let t = 1.0 / max(near.inverse, 1e-30);
    return select(0u, pack_texel(distance_code(t * t), near.slopes), near.inverse > 0.0);
}

// Texels a side of a block; a block shows one plane.
const BLOCK: u32 = 2u;

// Returns the four texels, row by row, of a block whose centre has the unit direction w and which shows the plane m.
fn block_texels(w: vec3f, m: vec3f) -> vec4u {
    let near = plane_nearness(w, m);
    let half = 0.5 * near.slopes;
    // 1 / distance is assumed linear within a block; the bound keeps it positive on planes seen nearly edge-on.
    let rises = max(
        1.0 + vec4f(-half.x - half.y, half.x - half.y, half.y - half.x, half.x + half.y), vec4f(0.1));
    let t = 1.0 / max(near.inverse, 1e-30);
    let codes = distance_code(t * t) + 2.0 * CODES_PER_OCTAVE * log2(rises);
    let texels = vec4u(
        pack_texel(codes.x, near.slopes / rises.x), pack_texel(codes.y, near.slopes / rises.y),
        pack_texel(codes.z, near.slopes / rises.z), pack_texel(codes.w, near.slopes / rises.w));
    return select(vec4u(0u), texels, near.inverse > 0.0);
}

// Returns the distance of a code, metres.
fn code_distance(code: f32) -> f32 {
    return 2.0 * scene.radius * exp2((0.5 - 0.5 * code) / CODES_PER_OCTAVE);
}

// Returns the plane m of a texel of unit direction w, distance t and slopes in steps: the inverse of plane_texel.
fn texel_plane(w: vec3f, t: f32, slopes: vec2f) -> vec3f {
    // d ln dot(m, w) / d place along x and y.
    const K: f32 = 2.0 * CODES_PER_OCTAVE / 0.6931472 / SLOPE_STEP;
    let relative = slopes * (f32(ISM_RESOLUTION) / (2.0 * K));
    // dw / d place along x and y; both span an area of 2.
    let s = sqrt(max(1.0 + w.z, 0.01));
    let x = w.xy / s;
    let along_x = vec3f(s - x.x * x.x / s, -x.x * x.y / s, -2.0 * x.x);
    let along_y = vec3f(-x.x * x.y / s, s - x.y * x.y / s, -2.0 * x.y);
    return (w + 0.5 * (relative.x * cross(along_y, w) + relative.y * cross(w, along_x))) / t;
}

// Returns the slopes of a texel's code along x and y, in steps of SLOPE_STEP per texel.
fn texel_slopes(texel: u32) -> vec2f {
    return vec2f(vec2i(extractBits(i32(texel), 8u, 8u), extractBits(i32(texel), 0u, 8u)));
}

// Returns the code of a texel's plane at an offset in texels from the texel's centre.
fn texel_code(texel: u32, offset: vec2f) -> f32 {
    return f32(texel >> 16u) + SLOPE_STEP * dot(texel_slopes(texel), offset);
}

// Returns the first texel of a slot's map in an atlas of a width in texels.
fn map_corner(slot: u32, atlas_width: u32) -> vec2u {
    let columns = atlas_width / ISM_RESOLUTION;
    return vec2u(slot % columns, slot / columns) * ISM_RESOLUTION;
}
