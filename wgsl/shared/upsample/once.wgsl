// Joint bilateral upsampling without a stored guide, for light that is upsampled once. The importing pass defines
// fn coarse_surface(pixel: vec2u) -> GuideSurface.
#import "shared/upsample/weights.wgsl"

@group(1) @binding(11) var<storage, read> coarse: array<vec4f>;

// Returns the light of `coarse` for a fine pixel. `size`: of the coarse picture, pixels; `per_metre`: coarse pixels
// per metre at the fine surface.
fn upsampled_once(pixel: vec2u, fine: GuideSurface, size: vec2u, per_metre: f32) -> vec3f {
    let taps = coarse_taps(pixel);
    var sum = vec4f(0.0);
    for (var k = 0u; k < 4u; k += 1u) {
        let at = tap_pixel(taps, k, size);
        let other = coarse_surface(at);
        let weight = bilateral_weight(taps.bilinear[k], similarity(fine, other, per_metre), other.exists);
        sum += weight * vec4f(coarse[at.y * size.x + at.x].rgb, 1.0);
    }
    return sum.rgb / max(sum.w, 1e-30);
}
