// The clusters that merge into trees, and what is known of each node.
//
// A node's id: a triangle's place in Morton order, or behind the triangles an inner node, in order of creation.

struct Cluster {
    node: u32,
    tree: u32,
}

struct State {
    count: u32,     // of clusters
    nodes: u32,     // created so far, with triangles
    pairing: u32,   // 1: neighbours merge, since hardly any clusters were each other's nearest
    round: u32,
    search: array<u32, 4>,  // workgroups of `nearest.wgsl`, and
    merge: array<u32, 4>,   // of `merge_count.wgsl` and `merge.wgsl`
}

// Wide levels of a tree; the top level takes the rest of `STACK_LEVELS` of upload/wide_bvh.py. With 13, the dragon's
// tree of 871,306 triangles costs 5 % more. Clusters merge only while the others could be paired within the rest, which
// takes log4 of their number.
const WIDE_LEVELS: u32 = 14u;
// A node becomes a leaf if testing its triangles costs no more than visiting it.
const MAX_LEAF: u32 = 4u;
const NODE_COST: f32 = 1.5;  // in tests of triangles; as upload/bvh.py

const NONE: u32 = 0xffffffffu;
const ALONE: u32 = 0xfffffffeu;  // the last cluster of a tree

// The `facts` of a node: triangles below; the least number of wide levels that it takes; whether it takes one less if it
// may be shown as two, or as three nodes of the level above; and whether it is a leaf.
const LEVELS_SHIFT: u32 = 24u;
const LOWER_AS_TWO: u32 = 0x10000000u;
const LOWER_AS_THREE: u32 = 0x20000000u;
const LEAF: u32 = 0x80000000u;

fn triangles_of(facts: u32) -> u32 {
    return facts & 0xffffffu;
}

// Returns how many wide levels a node takes as one, two and three nodes.
fn levels_of(facts: u32) -> vec3u {
    let levels = (facts >> LEVELS_SHIFT) & 15u;
    let lower = vec3<bool>(false, (facts & LOWER_AS_TWO) != 0u, (facts & LOWER_AS_THREE) != 0u);
    return vec3u(levels) - select(vec3u(0u), vec3u(1u), lower);
}

// Returns half the surface area of a box.
fn half_area(size: vec3f) -> f32 {
    return size.x * size.y + size.y * size.z + size.z * size.x;
}

// Clusters move from one half of their array to the other in each round; returns where those of a round begin.
fn half_of(round: u32, length: u32) -> u32 {
    return (round & 1u) * (length / 2u);
}
