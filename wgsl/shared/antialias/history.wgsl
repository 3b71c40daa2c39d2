// A pixel's anti-aliased light of the frames so far, in 16 bytes.
#import "common/light_code.wgsl"

struct History {
    light: vec3f,      // W/(m2 sr)
    coverage: f32,     // share of the pixel that surfaces cover
    frames: f32,       // number of frames in the mean, at most 255; 0: no history
    farthest: f32,     // distance within 3x3 pixels, metres along the ray; SKY_DISTANCE: no surface
}

const SKY_DISTANCE: f32 = 1e38;

fn pack_history(h: History) -> vec4u {
    let light = pack_light(h.light);
    return vec4u(light.x, light.y | (u32(round(h.frames)) << 24u), bitcast<u32>(h.coverage), bitcast<u32>(h.farthest));
}

// Returns light and coverage.
fn unpack_color(texel: vec4u) -> vec4f {
    return vec4f(unpack_light(texel.xy), bitcast<f32>(texel.z));
}

fn unpack_history(texel: vec4u) -> History {
    let color = unpack_color(texel);
    return History(color.rgb, color.a, f32(texel.y >> 24u), bitcast<f32>(texel.w));
}
