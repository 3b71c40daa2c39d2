// One invocation computes the weights to upsample from the search's grid to a pixel. The coarse surfaces are those
// of the grid's pixels in the G-buffer (`shared/upsample/grid_pixel.wgsl`).
//
// In: G-buffer. Out: the guide and the list of unrepresented pixels of `shared/upsample/guide.wgsl`.
#import "shared/upsample/guide.wgsl"
#import "shared/upsample/gbuffer_surface.wgsl"
#import "shared/upsample/corner.wgsl"
#import "scene/sequence.wgsl"

// A pixel is searched by itself where less of its weights, of a sum of 1, is on its own surface. Its single search is
// noisy. One bounce, 160x90, relMSE at 1 and 24 frames with 0.05, 0.15 and 0.3: Sponza (a) 3.01 .589, 2.88 .546, 2.82
// .489; Cornell's point light .217 .0280, .217 .0280, .254 .0281.
const LEAST_REPRESENTED: f32 = 0.15;

fn fine_surface(pixel: vec2u) -> GuideSurface {
    return gbuffer_guide_surface(pixel, false);
}

fn coarse_surface(pixel: vec2u) -> GuideSurface {
    return gbuffer_guide_surface(min(pixel * COARSE_STRIDE + corner_of(sequence.index), view.size - 1u), false);
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    find_guide(id.xy, vec2f(corner_of(sequence.index)), LEAST_REPRESENTED);
}
