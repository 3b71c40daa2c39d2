// One invocation encodes a pixel's radiance for the screen: exposure, tone curve, sRGB.
//
// The Khronos PBR Neutral curve without its toe, as `tone_map` in `wgpu_gi/pictures`: the identity up to 0.76,
// compressed and desaturated above. In: radiance, W/(m2 sr). Out: 8-bit sRGB.

struct Params {
    scale: f32,  // 2^exposure
}

@group(1) @binding(11) var<storage, read> radiance: array<vec4f>;
@group(1) @binding(12) var display: texture_storage_2d<rgba8unorm, write>;
@group(1) @binding(19) var<uniform> params: Params;

const START_COMPRESSION: f32 = 0.76;
const DESATURATION: f32 = 0.15;
const LARGEST: f32 = 1e30;  // keeps sums below in range

fn tone_map(radiance: vec3f) -> vec3f {
    let color = clamp(radiance, vec3f(0.0), vec3f(LARGEST));
    let peak = max(color.r, max(color.g, color.b));
    let d = 1.0 - START_COMPRESSION;
    let new_peak = 1.0 - d * d / max(peak + d - START_COMPRESSION, d);
    let compressed = color * (new_peak / max(peak, START_COMPRESSION));
    let grey = 1.0 - 1.0 / (DESATURATION * max(peak - new_peak, 0.0) + 1.0);
    return select(mix(compressed, vec3f(new_peak), grey), color, peak < START_COMPRESSION);
}

// IEC 61966-2-1. A polynomial of roots replaces the power, which is slower on CPU drivers: a minimax fit, off by at
// most 0.009 / 255.
fn srgb_from_linear(color: vec3f) -> vec3f {
    let x = clamp(color, vec3f(0.0), vec3f(1.0));
    let root = sqrt(x);
    let fourth = sqrt(root);
    let curve = -0.06461238 + 0.08132567 * x + 1.122668 * root + 0.1961416 * fourth - 0.3354887 * root * fourth;
    return select(curve, 12.92 * x, x <= vec3f(0.0031308));
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(display);
    if (any(id.xy >= size)) {
        return;
    }
    let color = tone_map(radiance[id.y * size.x + id.x].rgb * params.scale);
    textureStore(display, id.xy, vec4f(srgb_from_linear(color), 1.0));
}
