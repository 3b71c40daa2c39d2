// One invocation averages a pixel's luminance and its square over the frames of a still picture: the variance tells the
// blur noise from detail. In: light, W/m2. Out: moments, W/m2 and its square.
#import "scene/info.wgsl"
#import "scene/sequence.wgsl"
#import "common/math.wgsl"

override STRIDE: u32 = 1u;  // picture pixels per side of a pixel of the blurred grid

@group(1) @binding(11) var<storage, read> light: array<vec4f>;
@group(1) @binding(12) var<storage, read_write> moments: array<vec2f>;

@compute @workgroup_size(64, 4)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let size = (view.size + STRIDE - 1u) / STRIDE;
    if (any(id.xy >= size)) {
        return;
    }
    let index = id.y * size.x + id.x;
    let value = luminance(light[index].rgb);
    // Frame 0 starts over. Values above 1e18 have squares whose sums overflow float32.
    let now = min(value, 1e18);
    let before = select(vec2f(0.0), moments[index], sequence.still > 0u);
    moments[index] = before + (vec2f(now, now * now) - before) / f32(sequence.still + 1u);
}
