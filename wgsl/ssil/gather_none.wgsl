// One invocation gathers light without visibility. Errs bright behind occluders.
#import "ssil/gather.wgsl"

const DRAWS_PER_TEST: u32 = 1u;

fn prepare(start: Endpoint) {}

fn visibility(start: Endpoint, end: Endpoint, number: u32) -> vec3f {
    return vec3f(1.0);
}

@compute @workgroup_size(8, 8)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) thread: vec3u) {
    gather(group, thread);
}

@compute @workgroup_size(LIST_GROUP)
fn listed(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    gather_unrepresented(id.x, groups.x * LIST_GROUP);
}
