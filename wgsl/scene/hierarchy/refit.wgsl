// Each invocation computes the boxes of a wide node's children from their triangles, or from their own children.
//
// In: the nodes of one level; levels are taken from the last to the first. Leaves' boxes are those of their triangles'
// corners, exactly.
const EMPTY: u32 = 0x80000000u;
const LEAF: u32 = 0x80000000u;

struct Range {
    first: u32,
    count: u32,
}

struct Child {
    low: vec3f,
    reference: u32,  // as `WideBvh.child`
    high: vec3f,
    pad: u32,
}

@group(1) @binding(0) var<uniform> params: Range;
@group(1) @binding(1) var<storage, read> positions: array<f32>;  // 3 a vertex, metres
@group(1) @binding(2) var<storage, read> corners: array<u32>;    // 3 a triangle, in leaf order
@group(1) @binding(3) var<storage, read_write> nodes: array<array<Child, 4>>;

@compute @workgroup_size(256)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (id.x >= params.count) {
        return;
    }
    let node = params.first + id.x;
    for (var k = 0u; k < 4u; k += 1u) {
        let reference = nodes[node][k].reference;
        if (reference == EMPTY) {
            continue;
        }
        var low = vec3f(3e38);
        var high = vec3f(-3e38);
        if ((reference & LEAF) != 0u) {
            let first = 3u * (reference & 0x0fffffffu);
            let end = first + 3u * ((reference >> 28u) & 7u);
            for (var i = first; i < end; i += 1u) {
                let at = 3u * corners[i];
                let position = vec3f(positions[at], positions[at + 1u], positions[at + 2u]);
                low = min(low, position);
                high = max(high, position);
            }
        } else {
            for (var j = 0u; j < 4u; j += 1u) {
                if (nodes[reference][j].reference != EMPTY) {
                    low = min(low, nodes[reference][j].low);
                    high = max(high, nodes[reference][j].high);
                }
            }
        }
        nodes[node][k].low = low;
        nodes[node][k].high = high;
    }
}
