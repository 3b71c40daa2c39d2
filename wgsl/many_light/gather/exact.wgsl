// One invocation gathers for four pixels, with a shadow ray to each VPL of one word of their class: the equation of
// `gather.wgsl` with V by rays.
//
// In: G-buffer, VPLs, scene, results of the passes before. Out: irradiance, W/m2, and the coats' radiance, W/(m2 sr),
// summed over the passes. Errs bright where a blocker stands within STOP_SHORT of a VPL.
#import "many_light/gather/gather.wgsl"
#import "many_light/gather/shadow_rays.wgsl"

fn visibility(slot: u32, vpl: Vpl, at: Receivers) -> mat3x4f {
    let ab = trace_shadow_rays(shadow_ray(at.a, vpl), shadow_ray(at.b, vpl));
    let cd = trace_shadow_rays(shadow_ray(at.c, vpl), shadow_ray(at.d, vpl));
    return transpose(mat4x3f(ab.a, ab.b, cd.a, cd.b));
}

@compute @workgroup_size(GROUP_X, GROUP_Y)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) thread: vec3u) {
    // One word per pass: a driver may cut the loops of an invocation and of its SIMD group at 65535 iterations
    // (llvmpipe of Mesa 22), and each VPL takes four rays of about a hundred iterations.
    gather(place_of(group, thread), params.first_word, 1u);
}
