// One invocation sums the layers of one pixel and estimates the standard error of that mean.
//
// standard_error = sqrt(sum (x - mean)^2 / ((n - 1) n)) per channel; with one sample, the value itself. Errs high:
// stratification makes the true error smaller. In: means and squared deviations. Out: radiance with the coverage in
// its fourth value, and its error. All W/(m2 sr), squared deviations in squares of `scene.light_unit`, with which they
// neither overflow nor vanish.
#import "scene/info.wgsl"

struct Params {
    size: vec2u,  // pixels
}

@group(1) @binding(0) var<storage, read> emission: array<vec4f>;   // a: number of samples
@group(1) @binding(1) var<storage, read> direct: array<vec4f>;
@group(1) @binding(2) var<storage, read> indirect: array<vec4f>;
@group(1) @binding(3) var<storage, read> deviation: array<vec4f>;  // a: share of rays that hit a surface
@group(1) @binding(4) var<storage, read_write> radiance: array<vec4f>;
@group(1) @binding(5) var<storage, read_write> standard_error: array<vec4f>;
@group(1) @binding(19) var<uniform> params: Params;

@compute @workgroup_size(64, 4)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (any(id.xy >= params.size)) {
        return;
    }
    let index = id.y * params.size.x + id.x;
    let emitted = emission[index];
    let total = emitted.rgb + direct[index].rgb + indirect[index].rgb;
    let n = emitted.a;
    var error = total;
    if (n > 1.5) {
        error = sqrt(deviation[index].rgb / ((n - 1.0) * n)) * scene.light_unit;
    }
    radiance[index] = vec4f(total, deviation[index].a);
    standard_error[index] = vec4f(error, 1.0);
}
