// Each workgroup counts the digits of its tile.
#import "scene/hierarchy/sort_tile.wgsl"

var<workgroup> found: array<atomic<u32>, DIGITS>;

@compute @workgroup_size(THREADS)
fn main(@builtin(workgroup_id) tile: vec3u, @builtin(local_invocation_index) thread: u32) {
    // Not every driver zeroes this memory for each workgroup.
    if (thread < DIGITS) {
        atomicStore(&found[thread], 0u);
    }
    workgroupBarrier();
    let count = arrayLength(&pairs);
    let first = tile.x * THREADS * HELD + thread;
    for (var k = 0u; k < HELD; k += 1u) {
        let i = first + k * THREADS;
        if (i < count) {
            atomicAdd(&found[digit_of(pairs[i].x)], 1u);
        }
    }
    workgroupBarrier();
    if (thread < DIGITS) {
        counts[thread * tile_count() + tile.x] = atomicLoad(&found[thread]);
    }
}
