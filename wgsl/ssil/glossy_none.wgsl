// What coats reflect, without visibility. Errs bright where something stands between.
#import "ssil/glossy.wgsl"

fn prepare(start: Place) {}

fn visibility(start: Place, end: Place, number: u32) -> f32 {
    return 1.0;
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    gather_glossy(id);
}
