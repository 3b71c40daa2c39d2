// One invocation sums up the light of its class' VPLs for four pixels as if nothing stood between them.
//
// In: G-buffer, VPLs. Out: irradiance, W/m2, and what coats reflect. Errs bright where anything casts an indirect
// shadow.
#import "many_light/gather/gather.wgsl"
#import "shared/gbuffer/load.wgsl"

fn visibility(slot: u32, vpl: Vpl, at: Four) -> vec4f {
    return vec4f(1.0);
}

@compute @workgroup_size(GROUP_X, GROUP_Y)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) thread: vec3u) {
    let place = place_of(group, thread);
    gather(place, 0u, words_of_class(params.vpl_count, place.class_number));
}
