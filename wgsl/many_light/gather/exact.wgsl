// One invocation sums up the light of some of its class' VPLs for four pixels, with a ray to each.
//
// In: G-buffer, VPLs, scene. Out: irradiance, W/m2, and what coats reflect, added to by each pass. Errs where
// something stands within STOP_SHORT of a VPL.
#import "many_light/gather/gather.wgsl"
#import "many_light/gather/sight.wgsl"

fn visibility(slot: u32, vpl: Vpl, at: Four) -> vec4f {
    return vec4f(
        see_two(sight_of(at.a, vpl), sight_of(at.b, vpl)), see_two(sight_of(at.c, vpl), sight_of(at.d, vpl)));
}

@compute @workgroup_size(GROUP_X, GROUP_Y)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) thread: vec3u) {
    // A pass takes one word of each class: drivers may cut the loops of an invocation and of those that run in step with
    // it at 65535 iterations (llvmpipe of Mesa 22), and each VPL takes four rays of about a hundred.
    gather(place_of(group, thread), params.first_word, 1u);
}
