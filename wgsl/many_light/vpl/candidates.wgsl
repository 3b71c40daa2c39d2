// The candidates for virtual point lights: first the texels of all reflective shadow maps, then the vertices of all
// light paths. Their weights are summed in blocks.
#import "many_light/vpl/vpl.wgsl"

@group(1) @binding(13) var<storage, read> rsm: array<vec4u>;          // candidates at texels, vpl_words() vec4u each
@group(1) @binding(14) var<storage, read> light_paths: array<vec4u>;  // candidates at vertices

const BLOCK: u32 = 256u;  // candidates whose weights a workgroup sums

// Returns a candidate; `texels`: number of texels before the vertices.
fn load_candidate(index: u32, texels: u32) -> Vpl {
    var packed: PackedVpl;
    if (index < texels) {
        let first = vpl_words() * index;
        packed.place = rsm[first];
        packed.light = rsm[first + 1u];
        if (HAS_LOBES) {
            packed.arriving = rsm[first + 2u];
            packed.lobe = rsm[first + 3u];
        }
        return unpack_vpl(packed);
    }
    let first = vpl_words() * (index - texels);
    packed.place = light_paths[first];
    packed.light = light_paths[first + 1u];
    if (HAS_LOBES) {
        packed.arriving = light_paths[first + 2u];
        packed.lobe = light_paths[first + 3u];
    }
    return unpack_vpl(packed);
}
