// The surface that a direction hits, packed into two words. The first holds the pixel that shows the surface and its
// source: layers of depth peeling are sources 0 to 3, further cameras are sources 4 to 7. The second holds the
// direction from the receiver to it and its weight. Of off-screen hits by rays, the first word holds the
// radiance that arrives; of directions without a hit, or with a dark one, the second holds the direction alone, in 32
// bits.
#import "common/math.wgsl"

override LAYERS: u32 = 1u;   // of depth peeling, 1 to 4
override CAMERAS: u32 = 0u;  // besides the main one, 0 to 4

const NO_HIT: u32 = 0xffffffffu;
const UNKNOWN_HIT: u32 = 0xfffffffeu;  // the pictures do not show whether the direction hits
const DARK_HIT: u32 = 0xfffffffdu;   // it hits something of unknown light
const FIRST_CAMERA: u32 = 4u;

// Pictures have at most 2^13 pixels a side, so a pixel takes 26 bits.
fn pack_hit(pixel: vec2u, source: u32) -> u32 {
    return pixel.x | (pixel.y << 13u) | (source << 26u);
}

fn hit_pixel(hit: u32) -> vec2u {
    return vec2u(hit & 0x1fffu, (hit >> 13u) & 0x1fffu);
}

fn hit_source(hit: u32) -> u32 {
    return hit >> 26u;
}

struct HitDirection {
    direction: vec3f,  // unit, from the receiver
    weight: f32,       // of the hit, 0 to 1
    is_steep: bool,    // its sine above the receiver's surface exceeds LEAST_SINE
    has_light: bool,   // the first word holds radiance
}

// Sine of 1.7 degrees. Two surfaces that bend towards each other by less than twice that have a form factor below 0.1
// %, and pixels cannot resolve which of their directions hit: such pairs exchange no light.
const LEAST_SINE: f32 = 0.03;

const WEIGHT_STEPS: f32 = 510.0;
const HAS_LIGHT: u32 = 511u;  // in place of the weight

// Directions keep 11 bits for each octahedral coordinate, 0.1 degrees; weights keep 9 bits.
fn pack_hit_direction(hit: HitDirection) -> u32 {
    let octahedral = vec2u(round((octahedral_encode(hit.direction) * 0.5 + 0.5) * 2047.0));
    let weight = select(u32(round(saturate(hit.weight) * WEIGHT_STEPS)), HAS_LIGHT, hit.has_light);
    return octahedral.x | (octahedral.y << 11u) | (weight << 22u) | select(0u, 1u << 31u, hit.is_steep);
}

fn unpack_hit_direction(code: u32) -> HitDirection {
    let octahedral = vec2f(vec2u(code, code >> 11u) & vec2u(2047u)) * (2.0 / 2047.0) - 1.0;
    let weight = (code >> 22u) & 511u;
    return HitDirection(
        octahedral_decode(octahedral), min(f32(weight) * (1.0 / WEIGHT_STEPS), 1.0), (code >> 31u) != 0u,
        weight == HAS_LIGHT);
}

// Packs radiance with a common exponent (Ward 1991, "Real Pixels"): 8 bits for each channel and for the exponent.
fn pack_radiance(radiance: vec3f) -> u32 {
    let exponent = clamp(i32(bitcast<u32>(max3(radiance)) >> 23u) - 126, -100, 126);
    let code = vec3u(min(round(radiance * power_of_two(8 - exponent)), vec3f(255.0)));
    return code.r | (code.g << 8u) | (code.b << 16u) | (u32(exponent + 128) << 24u);
}

fn unpack_radiance(code: u32) -> vec3f {
    let mantissas = vec3f(vec3u(code, code >> 8u, code >> 16u) & vec3u(255u));
    return mantissas * power_of_two(i32(code >> 24u) - 136);
}

// Returns 2^exponent, exactly.
fn power_of_two(exponent: i32) -> f32 {
    return bitcast<f32>(u32(exponent + 127) << 23u);
}
