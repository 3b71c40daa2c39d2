// A pixel's history in 16 bytes: its mean light, and the surface that it belongs to.
#import "common/light_code.wgsl"

struct History {
    light: vec3f,
    frames: f32,     // number of frames in the mean, at most 255; 0: no history
    distance: f32,   // from the camera, metres
    normal: vec3f,   // unit, of the world
}

fn pack_history(h: History) -> vec4u {
    let light = pack_light(h.light);
    return vec4u(
        light.x, light.y | (u32(h.frames) << 24u), bitcast<u32>(h.distance),
        pack2x16snorm(octahedral_encode(h.normal)));
}

fn unpack_history(texel: vec4u) -> History {
    return History(
        unpack_light(texel.xy), f32(texel.y >> 24u), bitcast<f32>(texel.z),
        octahedral_decode(unpack2x16snorm(texel.w)));
}
