// One invocation gathers light with visibility by voxels. Errs as `gather.wgsl` and `voxels/march.wgsl` do.
#import "ssil/gather.wgsl"
#import "ssil/voxel_visibility.wgsl"

const DRAWS_PER_TEST: u32 = 1u;

@compute @workgroup_size(8, 8)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) thread: vec3u) {
    gather(group, thread);
}

@compute @workgroup_size(LIST_GROUP)
fn listed(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    gather_unrepresented(id.x, groups.x * LIST_GROUP);
}
