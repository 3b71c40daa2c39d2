// One invocation gathers a coat's reflection, without visibility. Errs bright behind occluders.
#import "ssil/glossy.wgsl"

fn prepare(start: Endpoint) {}

fn visibility(start: Endpoint, end: Endpoint, number: u32) -> f32 {
    return 1.0;
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    gather_glossy(id);
}
