// One workgroup computes the mean bound of N evenly spaced VPLs: sum_i s A_i / (N pi), with the bound of `bound.wgsl`.
//
// In: VPLs. Out: one value, m2. Exact if their number is N or divides N.
#import "many_light/vpl/table.wgsl"
#import "many_light/gather/bound.wgsl"

@group(1) @binding(11) var<storage, read_write> mean_bound: array<f32>;
@group(1) @binding(19) var<uniform> params: Params;

struct Params {
    vpl_count: u32,
}

const GROUP: u32 = 64u;
const PER_THREAD: u32 = 32u;

var<workgroup> sums: array<f32, GROUP>;

@compute @workgroup_size(64)
fn main(@builtin(local_invocation_index) thread: u32) {
    // Sum the bounds of PER_THREAD VPLs.
    const N = GROUP * PER_THREAD;
    var sum = 0.0;
    for (var k = 0u; k < PER_THREAD; k += 1u) {
        let slot = u32((f32(k * GROUP + thread) + 0.5) / f32(N) * f32(params.vpl_count));
        sum += bound_of(load_vpl(min(slot, params.vpl_count - 1u))) / f32(N);
    }
    sums[thread] = sum;
    // Add the sums of all threads, half of them at a time.
    for (var half = GROUP / 2u; half > 0u; half /= 2u) {
        workgroupBarrier();
        if (thread < half) {
            sums[thread] += sums[thread + half];
        }
    }
    if (thread == 0u) {
        mean_bound[0] = sums[0];
    }
}
