// One invocation computes the light that 2x2 pixels of the first level send in the next bounce, its workgroup that of
// coarser levels. Phi = E sum_j rho_j / pi ds_j.
//
// In: irradiance, W/m2; reflectors, m2/sr. Out: codes of `common/light_code.wgsl`, W/sr; the first level's brightest
// light, and the threshold of no light.
#import "ssil/light_levels.wgsl"
#import "ssil/peak.wgsl"

struct Params {
    size: vec2u,       // pixels of the first level
    bounce_threshold: f32,  // share of the brightest light of the first bounce that counts as none
}

@group(1) @binding(11) var<storage, read> reflectors: array<vec2u>;
@group(1) @binding(14) var<storage, read> irradiance: array<vec4f>;
@group(1) @binding(16) var<storage, read> first_peak: array<u32>;
@group(1) @binding(19) var<uniform> params: Params;

@compute @workgroup_size(TILE_THREADS, TILE_THREADS)
fn main(
    @builtin(global_invocation_id) id: vec3u, @builtin(local_invocation_id) local: vec3u,
    @builtin(workgroup_id) group: vec3u,
) {
    var sum = vec3f(0.0);
    var brightest = 0.0;
    for (var k = 0u; k < 4u; k += 1u) {
        let pixel = thread_pixel(id.xy, k);
        if (any(pixel >= params.size)) {
            continue;
        }
        let index = pixel.y * params.size.x + pixel.x;
        let sent = irradiance[index].rgb * unpack_light(reflectors[index]);
        sum += store_light(pixel, params.size, sent);
        brightest = max(brightest, max3(sent));
    }
    store_coarser(group.xy, local.xy, params.size, sum);
    raise_peak(brightest);
    if (all(id.xy == vec2u(0u))) {
        atomicStore(&peak[1], bitcast<u32>(params.bounce_threshold * bitcast<f32>(first_peak[0])));
    }
}
