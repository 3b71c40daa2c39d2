// One invocation computes the weights to upsample from the first gathered level to a pixel.
//
// In: surfels of the picture and of that level. Out: the guide and the list of unrepresented pixels of
// `shared/upsample/guide.wgsl`.
#import "shared/upsample/guide.wgsl"
#import "ssil/guide_surface.wgsl"
#import "ssil/corner.wgsl"
#import "scene/sequence.wgsl"

@group(1) @binding(14) var surfels: texture_storage_2d<rgba32uint, read>;
@group(1) @binding(15) var coarse_surfels: texture_storage_2d<rgba32uint, read>;

// A pixel gathers by itself where less of its weights, of a sum of 1, is on its own surface. Beside an edge the only
// receiver on it, a pixel away, is 0.25 to 0.5; there light changes too much from pixel to pixel. tools/README.md,
// "Constants".
const LEAST_REPRESENTED: f32 = 0.3;

fn fine_surface(pixel: vec2u) -> GuideSurface {
    return surfel_guide_surface(textureLoad(surfels, pixel));
}

fn coarse_surface(pixel: vec2u) -> GuideSurface {
    return surfel_guide_surface(textureLoad(coarse_surfels, pixel));
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    find_guide(id.xy, vec2f(receiver_place(sequence.index, COARSE_STRIDE)), LEAST_REPRESENTED);
}
