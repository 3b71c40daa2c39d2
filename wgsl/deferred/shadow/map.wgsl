// One vertex projects a point of an opaque surface into a shadow view. Out: depth, reversed; the nearest remains.
#import "deferred/shadow/vertices.wgsl"

@vertex
fn main(@builtin(vertex_index) index: u32, @builtin(instance_index) slot: u32) -> @builtin(position) vec4f {
    return shadow_vertex(index, slot);
}
