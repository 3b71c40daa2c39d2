// One vertex places a point of an opaque surface in the clip space of a shadow view; the depth that remains is the map.
#import "deferred/shadow/vertices.wgsl"

@vertex
fn main(@builtin(vertex_index) index: u32, @builtin(instance_index) slot: u32) -> @builtin(position) vec4f {
    return shadow_vertex(index, slot);
}
