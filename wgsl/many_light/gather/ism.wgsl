// One invocation gathers for four pixels from all VPLs of their class: the equation of `gather.wgsl` with V by
// imperfect shadow maps.
//
// In: G-buffer, VPLs, atlas of maps. Out: irradiance, W/m2, and the coats' radiance, W/(m2 sr). Errs as
// `ism/lookup.wgsl` does.
#import "many_light/gather/gather.wgsl"
#import "shared/gbuffer/load.wgsl"
#import "many_light/ism/lookup.wgsl"

fn visibility(slot: u32, vpl: Vpl, at: Receivers) -> mat3x4f {
    let map = vpl_map(slot, vpl);
    let visible = vec4f(
        map_visibility(map, at.a.position, at.a.normal), map_visibility(map, at.b.position, at.b.normal),
        map_visibility(map, at.c.position, at.c.normal), map_visibility(map, at.d.position, at.d.normal));
    return mat3x4f(visible, visible, visible);
}

@compute @workgroup_size(GROUP_X, GROUP_Y)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) thread: vec3u) {
    let place = place_of(group, thread);
    gather(place, 0u, words_of_class(params.vpl_count, place.class_number));
}
