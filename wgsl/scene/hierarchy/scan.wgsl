// One workgroup replaces each count by the sum of those before it.
#import "scene/hierarchy/prefix_sum.wgsl"
@group(1) @binding(0) var<storage, read_write> counts: array<u32>;

const THREADS: u32 = 256u;

@compute @workgroup_size(THREADS)
fn main(@builtin(local_invocation_index) thread: u32) {
    let count = arrayLength(&counts);
    var total = 0u;
    for (var first = 0u; first < count; first += THREADS) {
        let i = first + thread;
        var own = 0u;
        if (i < count) {
            own = counts[i];
        }
        let through = prefix_sum(thread, own);
        if (i < count) {
            counts[i] = total + through - own;
        }
        total += sums[THREADS - 1u];
        workgroupBarrier();
    }
}
