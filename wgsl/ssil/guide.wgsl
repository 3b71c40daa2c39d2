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

// A neighbour that rises above a pixel's surface at more than the angle of this sine, by more than this number of coarse
// pixels, and no farther than that number, hides light that the coarse pixels around it get.
const CONTACT_SINE: f32 = 0.5;
const CONTACT_RISE: f32 = 0.25;
const CONTACT_REACH: f32 = 4.0;
const ALWAYS: f32 = 2.0;  // no weights sum to as much

// Returns whether a pixel touches a surface that rises above its own: its light changes within a coarse pixel.
fn is_contact(pixel: vec2u) -> bool {
    let inside = min(pixel, view.size - 1u);
    let own = fine_surface(inside);
    let per_metre = pixels_per_metre(own.position) / f32(COARSE_STRIDE);
    var found = false;
    for (var k = 0; k < 9; k += 1) {
        let at = clamp(vec2i(inside) + vec2i(k % 3, k / 3) - 1, vec2i(0), vec2i(view.size) - 1);
        let other = fine_surface(vec2u(at));
        let way = other.position - own.position;
        let reach = length(way);
        let rise = dot(own.normal, way);
        let hides = rise > CONTACT_SINE * reach && rise * per_metre > CONTACT_RISE && reach * per_metre < CONTACT_REACH;
        found = found || (hides && own.exists && other.exists);
    }
    return found;
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let least = select(LEAST_REPRESENTED, ALWAYS, is_contact(id.xy));
    find_guide(id.xy, vec2f(receiver_place(sequence.index, COARSE_STRIDE)), least);
}
