// One invocation makes a sender of a pixel of the picture itself: what it reflects of light that was scattered once is
// known already; with FURTHER, L = direct + rho E / pi, E of what was scattered more often. In: direct, W/(m2 sr),
// irradiance W/m2. Out: L and the normal.
#import "shared/gbuffer/load.wgsl"

@group(1) @binding(11) var<storage, read> direct: array<vec4f>;
@group(1) @binding(12) var<storage, read_write> senders: array<vec4u>;
@group(1) @binding(13) var<storage, read> gathered: array<vec4f>;

override FURTHER: bool = false;

@compute @workgroup_size(64, 4)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (any(id.xy >= view.size)) {
        return;
    }
    let index = id.y * view.size.x + id.x;
    let surface = load_surface(id.xy);
    var sent = direct[index].rgb;
    if (FURTHER) {
        sent += gathered[index].rgb * gbuffer_brdf(surface).diffuse * INV_PI;
    }
    senders[index] = vec4u(bitcast<vec3u>(sent), pack2x16snorm(octahedral_encode(surface.normal)));
}
