// One invocation averages a pixel of a layer over the frames of a still picture: mean += (x - mean) / (k + 1) for frame
// k. In and out: W/(m2 sr).
#import "scene/info.wgsl"
#import "scene/sequence.wgsl"

@group(1) @binding(11) var<storage, read> current: array<vec4f>;
@group(1) @binding(12) var<storage, read_write> mean: array<vec4f>;

@compute @workgroup_size(64, 4)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (any(id.xy >= view.size)) {
        return;
    }
    let index = id.y * view.size.x + id.x;
    // Frame 0 starts over; the old contents may be of another picture, or NaN.
    let before = select(vec4f(0.0), mean[index], sequence.still > 0u);
    mean[index] = before + (current[index] - before) / f32(sequence.still + 1u);
}
