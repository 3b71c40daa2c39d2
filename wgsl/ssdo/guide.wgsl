// One invocation computes the weights to upsample from the grid of every COARSE_STRIDE-th pixel to a pixel. The coarse
// surfaces are those of the grid's pixels in the G-buffer.
//
// In: G-buffer. Out: the guide and the list of unrepresented pixels of `shared/upsample/guide.wgsl`.
#import "shared/upsample/guide.wgsl"
#import "shared/upsample/gbuffer_surface.wgsl"

// It is below 1 / 16, the least bilinear weight at a stride of 2, so one coarse pixel of the same surface suffices.
const LEAST_REPRESENTED: f32 = 0.05;

fn fine_surface(pixel: vec2u) -> GuideSurface {
    return gbuffer_guide_surface(pixel, false);
}

fn coarse_surface(pixel: vec2u) -> GuideSurface {
    return gbuffer_guide_surface(pixel * COARSE_STRIDE, false);
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    find_guide(id.xy, vec2f(0.0), LEAST_REPRESENTED);
}
