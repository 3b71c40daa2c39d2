// One invocation estimates the standard error of one pixel's mean over n samples.
//
// standard_error = sqrt(f sum (x - m)^2 / ((n - 1) n)) per channel; with one sample, the value itself. Stratified
// samples err less than independent ones, by f < 1: the variance by the halves of the samples
// (`reference/resolve.wgsl`) over that by their deviations, both summed over the neighbours. It falls as r / n + a / n^1.5, as in
// `shared/composite/standard_error.wgsl`. In: radiance, W/(m2 sr), squares in those of `scene.light_unit`. Out:
// W/(m2 sr). Errs high before the samples have doubled since the first run (f = 1), low beside edges.
#import "scene/info.wgsl"
#import "common/math.wgsl"

struct Params {
    size: vec2u,  // pixels
}

@group(1) @binding(0) var<storage, read> emission: array<vec4f>;   // a: number of samples
@group(1) @binding(1) var<storage, read> deviation: array<vec4f>;
@group(1) @binding(2) var<storage, read> radiance: array<vec4f>;
@group(1) @binding(3) var<storage, read> halves: array<vec4f>;
@group(1) @binding(4) var<storage, read_write> standard_error: array<vec4f>;
@group(1) @binding(19) var<uniform> params: Params;

const REACH: i32 = 2;  // neighbours to each side; the noise of pixels is independent
// Limits against noise of the sums: of the coarser spread over the spread, and of f.
const LEAST_RATIO: f32 = 0.5;
const MOST_RATIO: f32 = 2.0;
const LEAST_FACTOR: f32 = 0.01;
const MOST_FACTOR: f32 = 2.0;

// Returns the variance of the mean by the deviations of the samples, light_unit^2.
fn variance_at(index: u32) -> vec3f {
    let n = emission[index].a;
    return deviation[index].rgb / max((n - 1.0) * n, 1.0);
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (any(id.xy >= params.size)) {
        return;
    }
    let index = id.y * params.size.x + id.x;
    let unit = scene.light_unit;
    let own = luminance(radiance[index].rgb / unit);

    // Sum spreads and variances around, relative to their radiance.
    var sums = vec3f(0.0);
    for (var y = -REACH; y <= REACH; y++) {
        for (var x = -REACH; x <= REACH; x++) {
            let place = vec2i(id.xy) + vec2i(x, y);
            let inside = all(place >= vec2i(0)) && all(place < vec2i(params.size));
            let clamped = vec2u(clamp(place, vec2i(0), vec2i(params.size) - 1));
            let other = clamped.y * params.size.x + clamped.x;
            let value = luminance(radiance[other].rgb / unit);
            let counts = inside && halves[other].z >= 0.0;
            let weight = select(0.0, 1.0 / max(value * value + 0.1 * own * own, SMALLEST_NORMAL), counts);
            sums += weight * vec3f(halves[other].zw, luminance(variance_at(other)));
        }
    }

    // Extrapolate from the samples compared to all samples.
    let n = emission[index].a;
    let share = halves[index].y / max(n, 1.0);
    let coarser = clamp(sums.y, LEAST_RATIO * sums.x, MOST_RATIO * sums.x);
    let stratified = (coarser - sums.x) / (2.0 - sqrt(2.0));
    let variance = share * (sums.x - sqrt(2.0) * stratified + sqrt(share) * stratified);
    let known = sums.z > 0.0;
    let factor = select(1.0, clamp(variance / max(sums.z, SMALLEST_NORMAL), LEAST_FACTOR, MOST_FACTOR), known);
    let error = sqrt(factor * variance_at(index)) * unit;
    standard_error[index] = vec4f(select(radiance[index].rgb, error, n > 1.5), 1.0);
}
