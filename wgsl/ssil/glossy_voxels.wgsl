// One invocation gathers a coat's reflection, with visibility by voxels. Errs as `glossy.wgsl` does.
#import "ssil/glossy.wgsl"
#import "ssil/voxel_visibility.wgsl"

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    gather_glossy(id);
}
