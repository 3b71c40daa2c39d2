// Each invocation numbers an inner node if it is a wide node; the number, from 1, replaces its levels.
#import "scene/hierarchy/number.wgsl"

@group(1) @binding(1) var<storage, read> blocks: array<u32>;

var<workgroup> sums: array<u32, THREADS>;

@compute @workgroup_size(THREADS)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) thread: u32) {
    let place = group.x * THREADS + thread;
    let counts = is_wide(place);
    sums[thread] = u32(counts);
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
    if (counts) {
        wide[inner_at(place)].levels = blocks[group.x] + sums[thread];
    }
}
