// Each workgroup counts how many of its clusters remain, and how many pairs merge.
#import "scene/hierarchy/pairs.wgsl"

@group(1) @binding(2) var<storage, read_write> blocks: array<vec2u>;  // clusters that remain, new nodes

var<workgroup> sum: atomic<u32>;

@compute @workgroup_size(THREADS)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) thread: u32) {
    // Not every driver zeroes this memory for each workgroup.
    if (thread == 0u) {
        atomicStore(&sum, 0u);
    }
    workgroupBarrier();
    var own = 0u;
    for (var k = 0u; k < PLACES; k += 1u) {
        own += outcome_of((group.x * PLACES + k) * THREADS + thread);
    }
    if (own != 0u) {
        atomicAdd(&sum, own);
    }
    workgroupBarrier();
    if (thread == 0u) {
        let total = atomicLoad(&sum);
        blocks[group.x] = vec2u(total & 0xffffu, total >> 16u);
    }
}
