// The guide of joint bilateral upsampling for one fine pixel, and the list of unrepresented pixels: those whose
// surface no coarse pixel shows, which a technique computes at full resolution. The importing pass defines fn
// fine_surface(pixel: vec2u) -> GuideSurface and fn coarse_surface(pixel: vec2u) -> GuideSurface.
//
// Out: the weights of four coarse pixels, normalised, 8 bits each, 0 where there is no surface; the list, in no
// particular order, and the number of workgroups that cover it.
#import "shared/upsample/weights.wgsl"
#import "shared/upsample/list_group.wgsl"

@group(1) @binding(11) var<storage, read_write> guide: array<u32>;
@group(1) @binding(12) var<storage, read_write> unrepresented: array<u32>;
@group(1) @binding(13) var<storage, read_write> unrepresented_groups: array<atomic<u32>>;

fn list_pixel(index: u32) {
    let slot = atomicAdd(&unrepresented_groups[3], 1u);
    unrepresented[slot] = index;
    atomicMax(&unrepresented_groups[0], min(slot / LIST_GROUP + 1u, MAX_LIST_GROUPS));
    atomicStore(&unrepresented_groups[1], 1u);
    atomicStore(&unrepresented_groups[2], 1u);
}

// `origin`: the place of a coarse pixel's sample in its square, fine pixels. Coarse pixels represent a fine one if their
// bilinear weights times similarities sum to at least `least`.
fn find_guide(pixel: vec2u, origin: vec2f, least: f32) {
    if (any(pixel >= view.size)) {
        return;
    }
    let index = pixel.y * view.size.x + pixel.x;
    let fine = fine_surface(pixel);
    if (!fine.exists) {
        guide[index] = 0u;
        return;
    }
    let taps = coarse_taps(pixel);
    let size = (view.size + COARSE_STRIDE - 1u) / COARSE_STRIDE;
    let per_metre = pixels_per_metre(fine.position) / f32(COARSE_STRIDE);
    var weights = vec4f(0.0);
    var represented = 0.0;
    for (var k = 0u; k < 4u; k += 1u) {
        let other = coarse_surface(tap_pixel(taps, k, size));
        let similar = similarity(fine, other, per_metre);
        let away = vec2f(pixel) - origin - f32(COARSE_STRIDE) * vec2f(taps.first + vec2i(vec2u(k & 1u, k >> 1u)));
        let near = max(1.0 - abs(away) / f32(COARSE_STRIDE), vec2f(0.0));
        weights[k] = bilateral_weight(near.x * near.y, similar, other.exists);
        represented += near.x * near.y * similar;
    }
    guide[index] = pack4x8unorm(weights / max(dot(weights, vec4f(1.0)), 1e-30));
    if (represented < least) {
        list_pixel(index);
    }
}
