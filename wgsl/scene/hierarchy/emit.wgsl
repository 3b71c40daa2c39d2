// Each invocation writes a wide node: its children's boxes in metres, and references to them.
//
// Out: as many nodes, from `first` on, as the buffer holds.
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
@group(1) @binding(5) var<uniform> params: Part;

struct Part {
    first: u32,  // number of the first node, from 0
}

@compute @workgroup_size(256)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (id.x >= arrayLength(&wide)) {
        return;
    }
    let own = wide[id.x];
    // Places before the part wrap around to places behind it.
    let place = own.number - 1u - params.first;
    if (own.number == 0u || place >= arrayLength(&nodes)) {
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
        nodes[place][k] = child;
    }
}
