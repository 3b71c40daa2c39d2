// One invocation estimates the standard error of a pixel's mean over the frames of a still picture so far.
//
// standard_error = sqrt(sum (x - mean)^2 / ((n - 1) n)) per channel, n frames; of one frame, the value itself. In and
// out: W/(m2 sr), squared deviations in squares of `scene.light_unit`, with which they neither overflow nor vanish.
// Errs high where frames are stratified, low where they share state.
#import "scene/info.wgsl"
#import "scene/sequence.wgsl"

@group(1) @binding(11) var<storage, read> current: array<vec4f>;
@group(1) @binding(12) var<storage, read_write> centre: array<vec4f>;     // mean so far
@group(1) @binding(13) var<storage, read_write> deviation: array<vec4f>;  // sum of (x - mean)^2, light_unit^2
@group(1) @binding(14) var<storage, read_write> standard_error: array<vec4f>;

@compute @workgroup_size(64, 4)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (any(id.xy >= view.size)) {
        return;
    }
    let index = id.y * view.size.x + id.x;
    // Merge the frame with those before (Welford 1962). Frame 0 starts over; the old contents may be NaN.
    let is_first = sequence.still == 0u;
    let count = f32(sequence.still + 1u);
    let now = current[index].rgb;
    let before = select(centre[index].rgb, vec3f(0.0), is_first);
    let offset = now - before;
    let mean = before + offset / count;
    let product = (offset / scene.light_unit) * ((now - mean) / scene.light_unit);
    let squares = select(deviation[index].rgb + max(product, vec3f(0.0)), vec3f(0.0), is_first);
    centre[index] = vec4f(mean, 1.0);
    deviation[index] = vec4f(squares, 1.0);
    let error = sqrt(squares / max(count * (count - 1.0), 1.0)) * scene.light_unit;
    standard_error[index] = vec4f(select(error, now, is_first), 1.0);
}
