// One invocation makes a sender of a pixel of the picture itself: what it reflects of light that was scattered once is
// known already. In: direct, W/(m2 sr). Out: that and the normal.
#import "gbuffer/load.wgsl"

@group(1) @binding(11) var<storage, read> direct: array<vec4f>;
@group(1) @binding(12) var<storage, read_write> senders: array<vec4u>;

@compute @workgroup_size(64, 4)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (any(id.xy >= view.size)) {
        return;
    }
    let index = id.y * view.size.x + id.x;
    let normal = pack2x16snorm(octahedral_encode(load_surface(id.xy).normal));
    senders[index] = vec4u(bitcast<vec3u>(direct[index].rgb), normal);
}
