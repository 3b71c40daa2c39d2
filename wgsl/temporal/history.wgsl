// What is kept of a pixel from frame to frame: 16 bytes.
#import "common/math.wgsl"

struct History {
    light: vec3f,
    frames: f32,     // that it is the mean of, at most 255; 0: there is nothing
    distance: f32,   // from the camera, metres
    normal: vec3f,   // unit, of the world
}

// Colours share an exponent, with 16 bits each: 0.001 % of the largest is lost, at any scale of light.
// Returns 2^k, exactly, for -126 <= k <= 127.
fn power_of_two(k: i32) -> f32 {
    return bitcast<f32>(u32(k + 127) << 23u);
}

fn pack_history(h: History) -> vec4u {
    // The power of two above the largest.
    let exponent = clamp(i32(bitcast<u32>(max3(h.light)) >> 23u) - 126, -110, 127);
    let scaled = vec3u(min(round(h.light * 32768.0 * power_of_two(1 - exponent)), vec3f(65535.0)));
    let rest = (u32(exponent + 110) & 255u) | (u32(h.frames) << 8u);
    return vec4u(
        scaled.r | (scaled.g << 16u), scaled.b | (rest << 16u), bitcast<u32>(h.distance),
        pack2x16snorm(octahedral_encode(h.normal)));
}

fn unpack_history(texel: vec4u) -> History {
    let rest = texel.y >> 16u;
    let exponent = i32(rest & 255u) - 110;
    let scaled = vec3f(vec3u(texel.x & 0xffffu, texel.x >> 16u, texel.y & 0xffffu));
    return History(
        scaled * power_of_two(exponent - 16), f32(rest >> 8u), bitcast<f32>(texel.z),
        octahedral_decode(unpack2x16snorm(texel.w)));
}
