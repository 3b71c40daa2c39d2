// Each invocation writes a wide node: its children's boxes in metres, and references to them.
#import "scene/hierarchy/clusters.wgsl"

struct Wide {
    number: u32,  // from 1; 0: inside a wide node
    first: u32,
}

struct Child {
    low: vec3f,
    reference: u32,  // as in wgsl/scene/geometry.wgsl, but relative to the trees' first node and triangle
    high: vec3f,
    pad: u32,
}

@group(1) @binding(0) var<storage, read> lows: array<vec4f>;
@group(1) @binding(1) var<storage, read> highs: array<vec4f>;
@group(1) @binding(2) var<storage, read> kids: array<vec4u>;
@group(1) @binding(3) var<storage, read> wide: array<Wide>;
@group(1) @binding(4) var<storage, read_write> nodes: array<array<Child, 4>>;

@compute @workgroup_size(256)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (id.x >= arrayLength(&wide)) {
        return;
    }
    let own = wide[id.x];
    if (own.number == 0u) {
        return;
    }
    let leaves = arrayLength(&wide);
    var first = own.first;
    for (var k = 0u; k < 4u; k += 1u) {
        let node = kids[id.x][k];
        var child = Child(vec3f(0.0), LEAF, vec3f(0.0), 0u);
        if (node != NONE) {
            let low = lows[node];
            let facts = bitcast<u32>(low.w);
            child.low = low.xyz;
            child.high = highs[node].xyz;
            if ((facts & LEAF) != 0u) {
                child.reference = LEAF | (triangles_of(facts) << 28u) | first;
            } else {
                child.reference = wide[node - leaves].number - 1u;
            }
            first += triangles_of(facts);
        }
        nodes[own.number - 1u][k] = child;
    }
}
