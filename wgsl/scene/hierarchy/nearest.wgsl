// Each invocation finds a cluster's nearest neighbour: that with which it has the smallest common box.
//
// Meister and Bittner 2018, "Parallel Locally-Ordered Clustering for Bounding Volume Hierarchy Construction", section
// 3: among RADIUS neighbours on either side in Morton order. Each area is computed once for both clusters, as in Benthin
// et al. 2022, "PLOC++". Ties are broken alike from both sides, so that in each round some clusters are each other's
// nearest; where all boxes are equal, all merge.
#import "scene/hierarchy/clusters.wgsl"

@group(1) @binding(0) var<storage, read> state: State;
@group(1) @binding(1) var<storage, read> clusters: array<Cluster>;
@group(1) @binding(2) var<storage, read> lows: array<vec4f>;
@group(1) @binding(3) var<storage, read> highs: array<vec4f>;
@group(1) @binding(4) var<storage, read_write> nearest: array<u32>;  // by place among the clusters
@group(1) @binding(5) var<storage, read_write> roots: array<u32>;    // by tree

override SEVERAL_TREES: bool = false;

const THREADS: u32 = 128u;
// Of 16, trees cost 0.6 % more in the dragon and 3 % less in Sponza, and building takes 1.2 times as long.
const RADIUS: u32 = 8u;
const HELD: u32 = 144u;     // THREADS + 2 RADIUS
const PAIRED: u32 = 136u;   // THREADS + RADIUS: slots whose later neighbours are held, too
const AREAS: u32 = 1088u;   // RADIUS PAIRED

var<workgroup> box_lows: array<vec3f, HELD>;
var<workgroup> box_highs: array<vec3f, HELD>;
var<workgroup> trees: array<u32, HELD>;   // NONE: no cluster
var<workgroup> areas: array<f32, AREAS>;  // of common boxes, by distance, then by slot

// A cluster that may not merge has a box of this half size: larger than any other, with an area that does not overflow.
const HUGE: f32 = 1e18;
const FAR: f32 = 1e30;  // an area below that of such a box

fn load_cluster(place: u32, slot: u32) {
    // Places before the first wrap around and are above `count`, too.
    var low = vec3f(-HUGE);
    var high = vec3f(HUGE);
    var tree = NONE;
    if (place < state.count) {
        let cluster = clusters[half_of(state.round, arrayLength(&clusters)) + place];
        tree = cluster.tree;
        // log4(count), rounded up, levels must remain above the common node.
        let above = min((33u - countLeadingZeros(state.count - 1u)) / 2u, WIDE_LEVELS - 1u);
        let own = lows[cluster.node];
        if (levels_of(bitcast<u32>(own.w)).x + above < WIDE_LEVELS) {
            low = own.xyz;
            high = highs[cluster.node].xyz;
        }
    }
    box_lows[slot] = low;
    box_highs[slot] = high;
    trees[slot] = tree;
}

// Computes the areas of the boxes of a slot and each of the RADIUS slots behind it.
fn measure(slot: u32) {
    let low = box_lows[slot];
    let high = box_highs[slot];
    for (var k = 1u; k <= RADIUS; k += 1u) {
        let other = slot + k;
        var area = half_area(max(high, box_highs[other]) - min(low, box_lows[other]));
        if (SEVERAL_TREES && trees[slot] != trees[other]) {
            area = 2.0 * FAR;
        }
        areas[(k - 1u) * PAIRED + slot] = area;
    }
}

@compute @workgroup_size(THREADS)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) thread: u32) {
    // Load the boxes of the workgroup's clusters and of RADIUS more on either side.
    let first = group.x * THREADS;
    load_cluster(first + thread - RADIUS, thread);
    if (thread < 2u * RADIUS) {
        load_cluster(first + thread + THREADS - RADIUS, thread + THREADS);
    }
    workgroupBarrier();
    // Measure.
    measure(thread);
    if (thread < RADIUS) {
        measure(thread + THREADS);
    }
    workgroupBarrier();
    let i = first + thread;
    if (i >= state.count) {
        return;
    }
    let own = thread + RADIUS;
    if (trees[own - 1u] != trees[own] && trees[own + 1u] != trees[own]) {
        let cluster = clusters[half_of(state.round, arrayLength(&clusters)) + i];
        roots[cluster.tree] = cluster.node;
        nearest[i] = ALONE;
        return;
    }
    // Pair neighbours, beginning with the first in one round and with the second in the next.
    if (state.pairing != 0u) {
        let forward = ((i + state.round) & 1u) == 0u;
        let partner = select(own - 1u, own + 1u, forward);
        nearest[i] = select(NONE, select(i - 1u, i + 1u, forward), trees[partner] == trees[own]);
        return;
    }
    // Take the nearest on either side.
    var best = FAR;
    var place = NONE;
    for (var k = 1u; k <= RADIUS; k += 1u) {
        let left = areas[(k - 1u) * PAIRED + own - k];
        let right = areas[(k - 1u) * PAIRED + own];
        let prefers_right = (k & 1u & ~i) != 0u;
        let takes_right = right < left || (right == left && prefers_right);
        let area = select(left, right, takes_right);
        if (area < best) {
            best = area;
            place = select(i - k, i + k, takes_right);
        }
    }
    nearest[i] = place;
}
