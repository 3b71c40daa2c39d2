// Tests barriers, workgroup memory and atomics: an inclusive prefix sum in each workgroup, and a sum over all.
// prefix[i] = sum of value(k) over k <= i in the workgroup of i; total[0] = sum, total[1] = maximum of value(k) over
// all k. Integers modulo 2^32, so that the result does not depend on the order.
#import "common/random.wgsl"

const WIDTH: u32 = 256u;

@group(1) @binding(0) var<storage, read_write> prefix: array<u32>;
@group(1) @binding(1) var<storage, read_write> total: array<atomic<u32>>;

var<workgroup> sums: array<u32, WIDTH>;

fn value(i: u32) -> u32 {
    return hash(i) >> 8u;
}

@compute @workgroup_size(WIDTH)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(local_invocation_index) local: u32) {
    // Hillis and Steele 1986: add the sum that lies 1, 2, 4 ... places before.
    sums[local] = value(id.x);
    for (var step = 1u; step < WIDTH; step *= 2u) {
        workgroupBarrier();
        let before = select(0u, sums[max(local, step) - step], local >= step);
        workgroupBarrier();
        sums[local] += before;
    }
    prefix[id.x] = sums[local];
    atomicAdd(&total[0], value(id.x));
    atomicMax(&total[1], value(id.x));
}
