// One invocation estimates the standard error of a pixel's mean over the n frames of a still picture so far.
//
// Var(n) = r / n + a / n^1.5: frames that err independently have a = 0; Owen-scrambled points of an edge r = 0. At the
// last n = 2^k, the spread of the halves of the frames (`halves.wgsl`) is r / n + sqrt(2) a / n^1.5, the coarser one
// r / n + 2 a / n^1.5. Their ratio is that of sums over neighbours, the spread the pixel's own. In: mean, W/(m2 sr),
// and spreads in squares of `scene.light_unit`. Out: W/(m2 sr); of a single frame, which does not tell, the radiance
// itself. Calibrated in the mean over many pixels (tools/README.md); a pixel's own value errs by about its size, as a
// single difference. Errs low where frames share state, high for fewer than 16 frames.
#import "scene/info.wgsl"
#import "scene/sequence.wgsl"
#import "common/math.wgsl"

@group(1) @binding(11) var<storage, read> centre: array<vec4f>;  // mean of the frames so far
@group(1) @binding(12) var<storage, read> spread: array<vec4f>;
@group(1) @binding(13) var<storage, read> coarser_spread: array<vec4f>;
@group(1) @binding(14) var<storage, read_write> standard_error: array<vec4f>;

const REACH: i32 = 2;        // neighbours to each side
const STRIDE: i32 = 2;       // pixels between neighbours: noise of adjacent ones is alike after filters
// Limits of the ratio and of the factor below, against noise of the sums: measured on 22 pictures of 6 scenes.
const LEAST_RATIO: f32 = 0.5;
const MOST_RATIO: f32 = 2.0;
const LEAST_FACTOR: f32 = 0.1;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (any(id.xy >= view.size)) {
        return;
    }
    let index = id.y * view.size.x + id.x;
    let unit = scene.light_unit;
    let own = luminance(centre[index].rgb) / unit;

    // Sum the spreads around, relative to their radiance.
    var sums = vec2f(0.0);
    for (var y = -REACH; y <= REACH; y++) {
        for (var x = -REACH; x <= REACH; x++) {
            let place = vec2i(id.xy) + STRIDE * vec2i(x, y);
            let inside = all(place >= vec2i(0)) && all(place < vec2i(view.size));
            let clamped = vec2u(clamp(place, vec2i(0), vec2i(view.size) - 1));
            let other = clamped.y * view.size.x + clamped.x;
            let value = luminance(centre[other].rgb) / unit;
            let weight = select(0.0, 1.0 / max(value * value + 0.1 * own * own, SMALLEST_NORMAL), inside);
            sums += weight * vec2f(luminance(spread[other].rgb), luminance(coarser_spread[other].rgb));
        }
    }
    let ratio = clamp(sums.y / max(sums.x, SMALLEST_NORMAL), LEAST_RATIO, MOST_RATIO);

    // Extrapolate to the number of frames.
    let count = sequence.still + 1u;
    let share = f32(1u << firstLeadingBit(count)) / f32(count);
    let stratified = (ratio - 1.0) / (2.0 - sqrt(2.0));
    let factor = share * max(1.0 - sqrt(2.0) * stratified + sqrt(share) * stratified, LEAST_FACTOR);
    let error = select(sqrt(factor * spread[index].rgb) * unit, centre[index].rgb, count == 1u);
    standard_error[index] = vec4f(error, 1.0);
}
