// Each invocation numbers an inner node if it is a wide node; the number, from 1, replaces its levels.
#import "scene/hierarchy/number.wgsl"
#import "scene/hierarchy/prefix_sum.wgsl"

@group(1) @binding(1) var<storage, read> blocks: array<u32>;

@compute @workgroup_size(THREADS)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) thread: u32) {
    let place = group.x * THREADS + thread;
    let counts = is_wide(place);
    let through = prefix_sum(thread, u32(counts));
    if (counts) {
        wide[inner_at(place)].levels = blocks[group.x] + through;
    }
}
