// Upsamples coarse light by the weights that `shared/upsample/guide.wgsl` stored.
#import "shared/upsample/weights.wgsl"

@group(1) @binding(11) var<storage, read> coarse: array<vec4f>;
@group(1) @binding(12) var<storage, read> guide: array<u32>;

// Returns four weights; their sum is 1, or 0 where there is no surface.
fn load_guide(pixel: vec2u) -> vec4f {
    let weights = unpack4x8unorm(guide[pixel.y * view.size.x + pixel.x]);
    return weights / max(dot(weights, vec4f(1.0)), 0.5);
}

// Returns the index of the coarse value of a tap, 0 to 3.
fn tap_index(taps: CoarseTaps, k: u32) -> u32 {
    let size = (view.size + COARSE_STRIDE - 1u) / COARSE_STRIDE;
    let pixel = tap_pixel(taps, k, size);
    return pixel.y * size.x + pixel.x;
}

// Returns the light of `coarse` at a fine pixel.
fn upsampled(pixel: vec2u, weights: vec4f) -> vec3f {
    let taps = coarse_taps(pixel);
    let light = mat4x3f(
        coarse[tap_index(taps, 0u)].rgb, coarse[tap_index(taps, 1u)].rgb, coarse[tap_index(taps, 2u)].rgb,
        coarse[tap_index(taps, 3u)].rgb);
    return light * weights;
}
