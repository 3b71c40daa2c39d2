// The candidates for virtual point lights: first the texels of all reflective shadow maps, then the vertices of all
// light paths. Their weights are summed in blocks.
#import "many_light/vpl/vpl.wgsl"

@group(1) @binding(13) var<storage, read> rsm: array<vec4u>;          // candidates at texels, two vec4u each
@group(1) @binding(14) var<storage, read> light_paths: array<vec4u>;  // candidates at vertices

const BLOCK: u32 = 256u;  // candidates whose weights a workgroup sums

// Returns a candidate; `texels`: number of texels before the vertices.
fn load_candidate(index: u32, texels: u32) -> Vpl {
    if (index < texels) {
        return unpack_vpl(rsm[2u * index], rsm[2u * index + 1u]);
    }
    let vertex = index - texels;
    return unpack_vpl(light_paths[2u * vertex], light_paths[2u * vertex + 1u]);
}
