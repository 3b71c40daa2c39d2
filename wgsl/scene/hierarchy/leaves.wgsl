// Each invocation makes a cluster of a triangle, in Morton order.
#import "scene/hierarchy/triangles.wgsl"
#import "scene/hierarchy/clusters.wgsl"

@group(1) @binding(4) var<storage, read> pairs: array<vec2u>;  // key, triangle
@group(1) @binding(5) var<storage, read_write> lows: array<vec4f>;   // box, and `facts`
@group(1) @binding(6) var<storage, read_write> highs: array<vec4f>;  // box, and SAH cost
@group(1) @binding(7) var<storage, read_write> clusters: array<Cluster>;

@compute @workgroup_size(256)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let i = id.x;
    if (i >= arrayLength(&pairs)) {
        return;
    }
    let triangle = pairs[i].y;
    let box = triangle_box(triangle);
    lows[i] = vec4f(box.low, bitcast<f32>(LEAF | 1u));
    highs[i] = vec4f(box.high, half_area(box.high - box.low));
    clusters[i] = Cluster(i, tree_of(triangle));
}
