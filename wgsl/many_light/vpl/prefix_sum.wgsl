// One workgroup makes all blocks' sums of weights cumulative: 448 blocks at quality medium, 1,792 at high.
//
// One thread adds the sums from workgroup memory, in a fixed order; there are too few for a parallel sum to pay. In,
// out: weights.

@group(1) @binding(11) var<storage, read> block_sums: array<f32>;
@group(1) @binding(12) var<storage, read_write> totals: array<f32>;

const GROUP: u32 = 256u;

var<workgroup> sums: array<f32, GROUP>;

@compute @workgroup_size(256)
fn main(@builtin(local_invocation_index) thread: u32) {
    let count = arrayLength(&block_sums);
    var total = 0.0;  // of the first thread
    for (var first = 0u; first < count; first += GROUP) {
        let block = first + thread;
        if (block < count) {
            sums[thread] = block_sums[block];
        }
        workgroupBarrier();
        if (thread == 0u) {
            for (var k = 0u; k < min(GROUP, count - first); k += 1u) {
                total += sums[k];
                sums[k] = total;
            }
        }
        workgroupBarrier();
        if (block < count) {
            totals[block] = sums[thread];
        }
    }
}
