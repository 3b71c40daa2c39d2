// One invocation sums the layers of one pixel and, whenever its samples have doubled, compares their halves.
//
// spread = (A - m)^2 n_A / (n - n_A), A the mean of the first n_A samples and m that of all n: the variance of m if
// both halves err independently. In: means in W/(m2 sr). Out: radiance with the coverage in its fourth value, W/(m2 sr);
// spreads of its luminance in squares of `scene.light_unit`, with which they neither overflow nor vanish.
#import "scene/info.wgsl"
#import "common/math.wgsl"

struct Params {
    size: vec2u,         // pixels
    first_samples: u32,  // at most, of the first run
}

@group(1) @binding(0) var<storage, read> emission: array<vec4f>;   // a: number of samples
@group(1) @binding(1) var<storage, read> direct: array<vec4f>;
@group(1) @binding(2) var<storage, read> indirect: array<vec4f>;
@group(1) @binding(3) var<storage, read> deviation: array<vec4f>;  // a: share of rays that hit a surface
@group(1) @binding(4) var<storage, read_write> radiance: array<vec4f>;
// Mean of the samples up to the last comparison, and their number; spread, and the one before times n before / n.
// Negative spreads: none yet.
@group(1) @binding(5) var<storage, read_write> halves: array<vec4f>;
@group(1) @binding(19) var<uniform> params: Params;

@compute @workgroup_size(64, 4)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (any(id.xy >= params.size)) {
        return;
    }
    let index = id.y * params.size.x + id.x;
    let emitted = emission[index];
    let total = emitted.rgb + direct[index].rgb + indirect[index].rgb;
    radiance[index] = vec4f(total, deviation[index].a);

    let n = emitted.a;
    let mean = luminance(total / scene.light_unit);
    let before = halves[index];
    if ((n <= f32(params.first_samples)) | (n < before.y) | !(before.y > 0.0)) {
        // The picture has started over.
        halves[index] = vec4f(mean, n, -1.0, -1.0);
    } else if (n >= 2.0 * before.y) {
        let difference = before.x - mean;
        let spread = difference * difference * before.y / (n - before.y);
        let coarser = select(before.z * before.y / n, spread, before.z < 0.0);
        halves[index] = vec4f(mean, n, spread, coarser);
    }
}
