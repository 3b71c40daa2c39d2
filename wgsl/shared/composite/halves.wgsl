// One invocation adds a frame to a pixel's mean, and at frame counts n = 2^k compares the halves of the frames so far.
//
// spread = ((A - B) / 2)^2, A and B the means of the first and last n / 2 frames: the variance of the mean of all n if
// A and B err independently. coarser_spread = half the spread at n / 2: the same variance, if frames erred
// independently. In: radiance, W/(m2 sr). Out: spreads in squares of `scene.light_unit`, with which they neither
// overflow nor vanish. Random numbers are stratified over aligned blocks of 2^k frames (`common/random.wgsl`), which
// are therefore compared. Errs low where frames share state.
#import "scene/info.wgsl"
#import "scene/sequence.wgsl"

@group(1) @binding(11) var<storage, read> current: array<vec4f>;
@group(1) @binding(12) var<storage, read_write> centre: array<vec4f>;          // mean of the frames so far
@group(1) @binding(13) var<storage, read_write> half_mean: array<vec4f>;       // of the first 2^k frames
@group(1) @binding(14) var<storage, read_write> spread: array<vec4f>;
@group(1) @binding(15) var<storage, read_write> coarser_spread: array<vec4f>;

@compute @workgroup_size(64, 4)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (any(id.xy >= view.size)) {
        return;
    }
    let index = id.y * view.size.x + id.x;
    let now = current[index].rgb;
    // Frame 0 starts over; the old contents may be of another picture, or NaN.
    let is_first = sequence.still == 0u;
    let count = sequence.still + 1u;
    let before = select(centre[index].rgb, now, is_first);
    let mean = before + (now - before) / f32(count);
    centre[index] = vec4f(mean, 1.0);

    let completes = (count & (count - 1u)) == 0u;
    let prefix = select(half_mean[index].rgb, now, is_first);
    let old = select(spread[index].rgb, vec3f(0.0), is_first);
    // (A - B) / 2 is A less the mean of both.
    let difference = (prefix - mean) / scene.light_unit;
    let found = difference * difference;
    half_mean[index] = vec4f(select(prefix, mean, completes), 1.0);
    spread[index] = vec4f(select(old, found, completes), 1.0);
    // Two frames have no halves of more than one.
    let coarser = select(0.5 * old, found, count == 2u);
    coarser_spread[index] = vec4f(select(coarser_spread[index].rgb, coarser, completes), 1.0);
}
