// One invocation makes the sums of blocks cumulative. There are at most a few hundred.

@group(1) @binding(11) var<storage, read> blocks: array<f32>;
@group(1) @binding(12) var<storage, read_write> totals: array<f32>;

@compute @workgroup_size(1)
fn main() {
    var sum = 0.0;
    for (var k = 0u; k < arrayLength(&blocks); k += 1u) {
        sum += blocks[k];
        totals[k] = sum;
    }
}
