// One invocation gathers for four pixels from all VPLs of their class: the equation of `gather.wgsl` with V = 1.
//
// In: G-buffer, VPLs. Out: irradiance, W/m2, and the coats' radiance, W/(m2 sr). Errs bright in indirect shadows.
#import "many_light/gather/gather.wgsl"
#import "shared/gbuffer/load.wgsl"

fn visibility(slot: u32, vpl: Vpl, at: Receivers) -> mat3x4f {
    return mat3x4f(vec4f(1.0), vec4f(1.0), vec4f(1.0));
}

@compute @workgroup_size(GROUP_X, GROUP_Y)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) thread: vec3u) {
    let place = place_of(group, thread);
    gather(place, 0u, words_of_class(params.vpl_count, place.class_number));
}
