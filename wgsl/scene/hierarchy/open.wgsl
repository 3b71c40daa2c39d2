// What the passes share that turn binary trees into wide ones, from the roots down.
#import "scene/hierarchy/clusters.wgsl"

struct Wide {
    levels: u32,  // wide levels that may lie at and below the node; 0: the node is inside a wide node
    first: u32,   // leaf slot of the first triangle below
}

@group(1) @binding(0) var<storage, read> lows: array<vec4f>;
@group(1) @binding(1) var<storage, read> children: array<vec2u>;
@group(1) @binding(2) var<storage, read> pairs: array<vec2u>;  // key, triangle, in Morton order
@group(1) @binding(3) var<storage, read_write> wide: array<Wide>;  // by inner node
@group(1) @binding(4) var<storage, read_write> order: array<u32>;  // triangle of each leaf slot

fn facts_of(node: u32) -> u32 {
    return bitcast<u32>(lows[node].w);
}

// Writes the triangles below a leaf to the slots from `first` on.
fn list_triangles(leaf: u32, first: u32) {
    let count = arrayLength(&pairs);
    var slot = first;
    var node = leaf;
    var waiting = vec3u(0u);  // right siblings, the last first; a leaf of four has at most three
    var depth = 0u;
    loop {
        if (node >= count) {
            let pair = children[node - count];
            waiting = vec3u(pair.y, waiting.xy);
            depth += 1u;
            node = pair.x;
        } else {
            order[slot] = pairs[node].y;
            slot += 1u;
            if (depth == 0u) {
                break;
            }
            node = waiting.x;
            waiting = vec3u(waiting.yz, 0u);
            depth -= 1u;
        }
    }
}
