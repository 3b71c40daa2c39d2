// What coats reflect, with visibility by voxels.
#import "ssil/glossy.wgsl"
#import "ssil/through_voxels.wgsl"

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    gather_glossy(id);
}
