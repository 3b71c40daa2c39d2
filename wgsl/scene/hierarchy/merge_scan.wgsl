// One workgroup replaces the counts of each block by the sums of those before it, and prepares the next round.
#import "scene/hierarchy/clusters.wgsl"

@group(1) @binding(0) var<storage, read_write> blocks: array<vec2u>;
@group(1) @binding(1) var<storage, read> state: State;
@group(1) @binding(2) var<storage, read_write> next: State;
@group(1) @binding(3) var<storage, read_write> ends: array<u32>;  // nodes after each round

const THREADS: u32 = 256u;
// Neighbours are paired after a round that merged less than one in so many clusters. Rounds usually merge one in 5.
const FEW: u32 = 64u;

var<workgroup> sums: array<vec2u, THREADS>;

@compute @workgroup_size(THREADS)
fn main(@builtin(local_invocation_index) thread: u32) {
    let end = state.merge[0];
    var total = vec2u(0u);
    for (var first = 0u; first < end; first += THREADS) {
        let i = first + thread;
        var own = vec2u(0u);
        if (i < end) {
            own = blocks[i];
        }
        sums[thread] = own;
        workgroupBarrier();
        for (var step = 1u; step < THREADS; step <<= 1u) {
            var before = vec2u(0u);
            if (thread >= step) {
                before = sums[thread - step];
            }
            workgroupBarrier();
            sums[thread] += before;
            workgroupBarrier();
        }
        if (i < end) {
            blocks[i] = total + sums[thread] - own;
        }
        total += sums[THREADS - 1u];
        workgroupBarrier();
    }
    if (thread == 0u) {
        // Once no cluster is left, the round stays as it is.
        next.count = total.x;
        next.nodes = state.nodes + total.y;
        next.pairing = u32(total.y * FEW < state.count);
        next.round = state.round + u32(state.count > 0u);
        next.search = array<u32, 4>((total.x + 127u) / 128u, 1u, 1u, 0u);
        next.merge = array<u32, 4>((total.x + 1023u) / 1024u, 1u, 1u, 0u);
        ends[next.round] = next.nodes;
    }
}
