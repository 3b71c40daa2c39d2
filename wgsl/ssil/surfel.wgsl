// A pixel of a level: the surface that it represents, packed into 16 bytes.
#import "scene/info.wgsl"
#import "common/math.wgsl"

const AREA_ONE: u32 = 0x3f800000u;   // the bits of 1.0
const AREA_STEP: u32 = 0x00100000u;  // between floats with 3 bits of mantissa

struct Surfel {
    position: vec3f,  // metres from the camera, world axes
    normal: vec3f,    // unit, shading, towards the viewer
    area: f32,        // of all surfaces in the pixel's square, m2
}

// Returns v such that dot(position, v.xyz) + v.w is the side, metres, of a pixel of the picture on a plane that faces
// the camera. Call it before loops: it loads from the view.
fn facing_side() -> vec4f {
    let side = sqrt(4.0 * length(view.right) * length(view.up) / f32(view.size.x * view.size.y));
    return side * select(vec4f(view.forward, 0.0), vec4f(0.0, 0.0, 0.0, 1.0), view.orthographic != 0u);
}

// Returns the area of a facing pixel, m2; `facing`: facing_side().
fn facing_area(position: vec3f, facing: vec4f) -> f32 {
    let side = dot(position, facing.xyz) + facing.w;
    return side * side;
}

// Normals take 12 bits per octahedral coordinate, with 0 and 1 exact. Areas take 8 bits, as a float with 3 bits of
// mantissa relative to the facing pixel: the error is at most 6 %, and affects only the bound of near light.
fn pack_surfel(s: Surfel, facing: vec4f) -> vec4u {
    let normal = vec2u(round(octahedral_encode(s.normal) * 2047.0) + 2048.0);
    let share = clamp(s.area / max(facing_area(s.position, facing), 1e-37), 1.0, 3e9);
    let area = (bitcast<u32>(share) - AREA_ONE + AREA_STEP / 2u) / AREA_STEP;
    return vec4u(bitcast<vec3u>(s.position), normal.x | (normal.y << 12u) | ((area + 1u) << 24u));
}

fn is_empty(texel: vec4u) -> bool {
    return texel.w == 0u;
}

fn surfel_position(texel: vec4u) -> vec3f {
    return bitcast<vec3f>(texel.xyz);
}

fn surfel_normal(texel: vec4u) -> vec3f {
    return octahedral_decode((vec2f(vec2u(texel.w, texel.w >> 12u) & vec2u(4095u)) - 2048.0) * (1.0 / 2047.0));
}

fn surfel_area(texel: vec4u, facing: vec4f) -> f32 {
    let share = bitcast<f32>((texel.w >> 24u) * AREA_STEP + (AREA_ONE - AREA_STEP));
    return facing_area(surfel_position(texel), facing) * share;
}
