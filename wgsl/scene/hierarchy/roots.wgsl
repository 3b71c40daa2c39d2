// Each invocation begins a tree: its root becomes a wide node, or a leaf.
#import "scene/hierarchy/open.wgsl"

@group(1) @binding(5) var<storage, read> roots: array<u32>;   // by tree
@group(1) @binding(6) var<storage, read> firsts: array<u32>;  // triangle of each tree

@compute @workgroup_size(256)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (id.x >= arrayLength(&roots)) {
        return;
    }
    let root = roots[id.x];
    if ((facts_of(root) & LEAF) != 0u) {
        list_triangles(root, firsts[id.x]);
    } else {
        wide[root - arrayLength(&pairs)] = Wide(WIDE_LEVELS, firsts[id.x]);
    }
}
