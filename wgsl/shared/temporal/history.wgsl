// A pixel's history in 16 bytes: its mean light, and the surface that it belongs to.
#import "common/light_code.wgsl"

struct History {
    light: vec3f,
    frames: f32,     // number of frames in the mean, at most 255; 0: no history
    distance: f32,   // from the camera, metres
    normal: vec3f,   // unit, of the world
    spread: f32,     // usual change of the neighbours' mean from frame to frame, as a share of it; in steps of 4 %
    drawn: u32,      // lowest 2 bits of the number of the random numbers that the last frame drew
}

// `spread` is stored as its logarithm from 2^-8 on, in sixteenths of an octave.
const SPREAD_OCTAVES: f32 = 8.0;
const SPREAD_STEPS: f32 = 16.0;

fn pack_history(h: History) -> vec4u {
    let light = pack_light(h.light);
    let normal = bitcast<vec2u>(vec2i(round(clamp(octahedral_encode(h.normal), vec2f(-1.0), vec2f(1.0)) * 1023.0)));
    let spread = u32(clamp(round((log2(max(h.spread, 1e-9)) + SPREAD_OCTAVES) * SPREAD_STEPS), 0.0, 255.0));
    return vec4u(
        light.x, light.y | (u32(round(h.frames)) << 24u), bitcast<u32>(h.distance),
        (normal.x & 0x7ffu) | ((normal.y & 0x7ffu) << 11u) | (spread << 22u) | (h.drawn << 30u));
}

fn unpack_history(texel: vec4u) -> History {
    let normal = vec2f(bitcast<vec2i>(vec2u(texel.w << 21u, texel.w << 10u)) >> vec2u(21u)) / 1023.0;
    let spread = f32((texel.w >> 22u) & 255u) / SPREAD_STEPS - SPREAD_OCTAVES;
    return History(
        unpack_light(texel.xy), f32(texel.y >> 24u), bitcast<f32>(texel.z), octahedral_decode(normal), exp2(spread),
        texel.w >> 30u);
}

// What the reprojection finds for a pixel, in 16 bytes.
struct Found {
    light: vec3f,   // the history at the pixel
    frames: f32,    // 0: no history
    depth: f32,     // of this frame's surface, as in `shared/denoise/plane.wgsl`; 0: nothing to light
    normal: u32,    // of this frame's surface, packed as there
}

fn pack_found(f: Found) -> vec4u {
    let light = pack_light(f.light);
    return vec4u(light.x, light.y | (u32(round(f.frames)) << 24u), bitcast<u32>(f.depth), f.normal);
}

fn unpack_found(texel: vec4u) -> Found {
    return Found(unpack_light(texel.xy), f32(texel.y >> 24u), bitcast<f32>(texel.z), texel.w);
}
