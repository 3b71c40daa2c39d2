// Colours in 7 bytes: a shared exponent and 16 bits per channel. The error is at most 2^-16 of the largest channel at
// any scale; doubling the light exactly doubles the decoded colour.
#import "common/math.wgsl"

// Returns 2^k, exactly, for -126 <= k <= 127.
fn power_of_two(k: i32) -> f32 {
    return bitcast<f32>(u32(k + 127) << 23u);
}

// Returns the code; the highest 8 bits of y are free.
fn pack_light(light: vec3f) -> vec2u {
    // The power of two above the largest channel.
    let exponent = clamp(i32(bitcast<u32>(max3(light)) >> 23u) - 126, -110, 127);
    let scaled = vec3u(min(round(light * 32768.0 * power_of_two(1 - exponent)), vec3f(65535.0)));
    return vec2u(scaled.r | (scaled.g << 16u), scaled.b | (u32(exponent + 110) << 16u));
}

fn unpack_light(code: vec2u) -> vec3f {
    let exponent = i32((code.y >> 16u) & 255u) - 110;
    return vec3f(vec3u(code.x & 0xffffu, code.x >> 16u, code.y & 0xffffu)) * power_of_two(exponent - 16);
}
