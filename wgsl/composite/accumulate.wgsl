// One invocation averages a layer over jittered frames: mean += (x - mean) / (k + 1) for frame k.
#import "scene/info.wgsl"

struct Params {
    count: u32,
}

@group(1) @binding(11) var<storage, read> current: array<vec4f>;
@group(1) @binding(12) var<storage, read_write> mean: array<vec4f>;
@group(1) @binding(19) var<uniform> params: Params;

@compute @workgroup_size(256)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let index = id.x;
    if (index >= params.count) {
        return;
    }
    // Frame 0 replaces what was there, whatever that was.
    let before = select(vec4f(0.0), mean[index], view.sample_index > 0u);
    mean[index] = before + (current[index] - before) / f32(view.sample_index + 1u);
}
