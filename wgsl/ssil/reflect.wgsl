// One invocation finds the light that a pixel of the first level sends on, from what it got: Phi = E * sum rho / pi ds.
// With ADDED, together with what it sends already. In: irradiance, W/m2. Out: codes of `common/light_code.wgsl`; the
// largest of them, and what counts as none, as bits of floats.
#import "common/light_code.wgsl"

override ADDED: bool = false;

struct Params {
    least_light: f32,  // of the brightest light of the first bounce, what counts
}

const ROW: u32 = 4096u;  // threads along x: large pictures need more workgroups than a dispatch has along one axis

@group(1) @binding(11) var<storage, read> reflectors: array<vec2u>;
@group(1) @binding(12) var<storage, read> irradiance: array<vec4f>;
@group(1) @binding(13) var<storage, read_write> light: array<vec2u>;
@group(1) @binding(14) var<storage, read_write> peak: array<atomic<u32>>;
@group(1) @binding(15) var<storage, read> before: array<vec2u>;
@group(1) @binding(16) var<storage, read> first_peak: array<u32>;
@group(1) @binding(19) var<uniform> params: Params;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let index = id.y * ROW + id.x;
    if (index >= arrayLength(&light)) {
        return;
    }
    var sent = irradiance[index].rgb * unpack_light(reflectors[index]);
    if (ADDED) {
        sent += unpack_light(before[index]);
    }
    light[index] = pack_light(sent);
    if (index == 0u) {
        atomicStore(&peak[1], bitcast<u32>(params.least_light * bitcast<f32>(first_peak[0])));
    }
    let bits = bitcast<u32>(max3(sent));
    // Reading first is cheaper where it is not the largest, which is the rule.
    if (bits > atomicLoad(&peak[0])) {
        atomicMax(&peak[0], bits);
    }
}
