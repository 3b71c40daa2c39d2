// Each invocation moves clusters to their places in the next round; of two that merge, the first makes their node.
//
// A node knows what it costs by the surface area heuristic to show it as one, two or three nodes of a tree with four
// children a node: Ylitie et al. 2017, "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs",
// section 3.1. `collapse.wgsl` chooses by these costs.
#import "scene/hierarchy/pairs.wgsl"
#import "scene/hierarchy/prefix_sum.wgsl"

@group(1) @binding(2) var<storage, read> blocks: array<vec2u>;  // clusters and new nodes before each block
@group(1) @binding(3) var<storage, read_write> clusters: array<Cluster>;
@group(1) @binding(4) var<storage, read_write> lows: array<vec4f>;
@group(1) @binding(5) var<storage, read_write> highs: array<vec4f>;
@group(1) @binding(6) var<storage, read_write> children: array<vec2u>;  // of inner nodes
@group(1) @binding(7) var<storage, read_write> costs: array<vec2f>;     // of inner nodes, as two and as three

// Returns the costs of showing a node as one, two and three.
fn costs_of(node: u32, cost: f32) -> vec3f {
    let triangles = arrayLength(&clusters) / 2u;
    if (node < triangles) {
        return vec3f(cost);
    }
    return vec3f(cost, costs[node - triangles]);
}

// Writes the node over two others.
fn make_node(node: u32, left: u32, right: u32) {
    let low_left = lows[left];
    let low_right = lows[right];
    let high_left = highs[left];
    let high_right = highs[right];
    let low = min(low_left.xyz, low_right.xyz);
    let high = max(high_left.xyz, high_right.xyz);
    // Share out four children, or make a leaf.
    let facts_left = bitcast<u32>(low_left.w);
    let facts_right = bitcast<u32>(low_right.w);
    let a = costs_of(left, high_left.w);
    let b = costs_of(right, high_right.w);
    let count = triangles_of(facts_left) + triangles_of(facts_right);
    let area = half_area(high - low);
    let cost = NODE_COST * area + min(min(a.x + b.z, a.z + b.x), a.y + b.y);
    let cost_of_leaf = area * f32(count);
    let is_leaf = count <= MAX_LEAF && cost_of_leaf <= cost;
    let one = select(cost, cost_of_leaf, is_leaf);
    let two = min(one, a.x + b.x);
    let three = min(two, min(a.x + b.y, a.y + b.x));
    // Do the same for the levels that it takes.
    let i = levels_of(facts_left);
    let j = levels_of(facts_right);
    let levels = 1u + min(min(max(i.x, j.z), max(i.z, j.x)), max(i.y, j.y));
    let levels_two = max(i.x, j.x);
    let levels_three = min(max(i.x, j.y), max(i.y, j.x));
    let inner_facts = (levels << LEVELS_SHIFT) | select(0u, LOWER_AS_TWO, levels_two < levels)
        | select(0u, LOWER_AS_THREE, levels_three < levels);
    // Write all of it.
    let inner = node - arrayLength(&clusters) / 2u;
    lows[node] = vec4f(low, bitcast<f32>(count | select(inner_facts, LEAF, is_leaf)));
    highs[node] = vec4f(high, one);
    children[inner] = vec2u(left, right);
    costs[inner] = vec2f(two, three);
}

@compute @workgroup_size(THREADS)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) thread: u32) {
    // Sum the outcomes of the threads before.
    let first = (group.x * THREADS + thread) * PLACES;
    var own = 0u;
    var outcomes = 0u;  // two bits each
    for (var k = 0u; k < PLACES; k += 1u) {
        let outcome = outcome_of(first + k);
        own += outcome;
        outcomes |= min(outcome, 2u) << (2u * k);
    }
    let through = prefix_sum(thread, own);
    let before = through - own;
    // Move clusters, and make nodes.
    let length = arrayLength(&clusters);
    let source = half_of(state.round, length);
    var place = half_of(state.round + 1u, length) + blocks[group.x].x + (before & 0xffffu);
    var node = state.nodes + blocks[group.x].y + (before >> 16u);
    for (var k = 0u; k < PLACES; k += 1u) {
        let i = first + k;
        let outcome = (outcomes >> (2u * k)) & 3u;
        if (outcome != 0u) {
            var cluster = clusters[source + i];
            if (outcome == 2u) {
                make_node(node, cluster.node, clusters[source + nearest[i]].node);
                cluster.node = node;
                node += 1u;
            }
            clusters[place] = cluster;
            place += 1u;
        }
    }
}
