// One invocation places the start of a light path from the environment on the scene's surfaces, in proportion to their
// area.
//
// Each frame of a still picture continues the low-discrepancy sequence, so the mean of many frames converges. In:
// cumulative areas, scene. Out: points as `many_light/points/table.wgsl` reads them. Exact.
#import "scene/sequence.wgsl"
#import "many_light/points/draw.wgsl"

@group(1) @binding(19) var<uniform> params: Params;

struct Params {
    seed: u32,
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let count = arrayLength(&points) / 2u;
    if (id.x < count) {
        store_point(id.x, id.x + sequence.index * count, count, params.seed);
    }
}
