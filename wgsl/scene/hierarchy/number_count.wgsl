// Each workgroup counts the wide nodes among its inner nodes, which it takes in reverse order of creation.
#import "scene/hierarchy/number.wgsl"

@group(1) @binding(1) var<storage, read_write> blocks: array<u32>;

var<workgroup> sum: atomic<u32>;

@compute @workgroup_size(THREADS)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) thread: u32) {
    // Not every driver zeroes this memory for each workgroup.
    if (thread == 0u) {
        atomicStore(&sum, 0u);
    }
    workgroupBarrier();
    if (is_wide(group.x * THREADS + thread)) {
        atomicAdd(&sum, 1u);
    }
    workgroupBarrier();
    if (thread == 0u) {
        blocks[group.x] = atomicLoad(&sum);
    }
}
