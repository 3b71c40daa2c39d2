// One invocation computes the share of a VPL's light that the near field finds at distance 0.
//
// In: VPLs, G-buffer. Out: a share per slot, in the rows of the table. Errs as `share.wgsl` does.
#import "many_light/vpl/table.wgsl"
#import "shared/gbuffer/load.wgsl"
#import "many_light/near_field/share.wgsl"

@group(1) @binding(11) var near_shares: texture_storage_2d<r32float, write>;
@group(1) @binding(19) var<uniform> params: Params;

struct Params {
    count: u32,  // of VPLs
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let slot = id.x;
    if (slot >= params.count) {
        return;
    }
    let vpl = load_vpl(slot);
    textureStore(near_shares, vpl_texel(slot), vec4f(near_share_of(vpl.position, vpl.normal)));
}
