// One workgroup makes all blocks' sums of weights cumulative: 448 blocks at quality medium, 1,792 at high.
//
// Each thread adds a span of consecutive blocks; the spans' sums become cumulative by rows of ROW. The order is fixed,
// so results repeat, and rounding never makes a sum smaller than the one before it. In, out: weights.

@group(1) @binding(11) var<storage, read> block_sums: array<f32>;
@group(1) @binding(12) var<storage, read_write> totals: array<f32>;

const GROUP: u32 = 256u;
const ROW: u32 = 16u;  // spans; as many as rows

var<workgroup> sums: array<f32, GROUP>;

@compute @workgroup_size(256)
fn main(@builtin(local_invocation_index) thread: u32) {
    // Sum the span.
    let count = arrayLength(&block_sums);
    let span = (count + GROUP - 1u) / GROUP;
    let first = min(thread * span, count);
    let end = min(first + span, count);
    var sum = 0.0;
    for (var block = first; block < end; block += 1u) {
        sum += block_sums[block];
    }
    sums[thread] = sum;
    workgroupBarrier();
    // Make the sums cumulative within each row.
    if (thread < GROUP / ROW) {
        for (var k = ROW * thread + 1u; k < ROW * (thread + 1u); k += 1u) {
            sums[k] += sums[k - 1u];
        }
    }
    workgroupBarrier();
    // Add the rows before this one.
    var total = 0.0;
    for (var k = ROW - 1u; k < thread / ROW * ROW; k += ROW) {
        total += sums[k];
    }
    let upto = total + sums[thread];
    total += select(0.0, sums[max(thread, 1u) - 1u], thread % ROW > 0u);
    // Store the sums of the span; the next one continues from `upto`.
    for (var block = first; block < end; block += 1u) {
        total = min(total + block_sums[block], upto);
        totals[block] = total;
    }
}
