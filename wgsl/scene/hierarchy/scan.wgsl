// One workgroup replaces each count by the sum of those before it.
@group(1) @binding(0) var<storage, read_write> counts: array<u32>;

const THREADS: u32 = 256u;
var<workgroup> sums: array<u32, THREADS>;

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
        sums[thread] = own;
        workgroupBarrier();
        for (var step = 1u; step < THREADS; step <<= 1u) {
            var before = 0u;
            if (thread >= step) {
                before = sums[thread - step];
            }
            workgroupBarrier();
            sums[thread] += before;
            workgroupBarrier();
        }
        if (i < count) {
            counts[i] = total + sums[thread] - own;
        }
        total += sums[THREADS - 1u];
        workgroupBarrier();
    }
}
