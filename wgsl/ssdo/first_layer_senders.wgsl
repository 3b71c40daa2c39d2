// One invocation stores a pixel of the first layer as a sender: L = direct, with HAS_INDIRECT + rho E / pi.
//
// In: direct light, W/(m2 sr), as the surface reflects it; irradiance E of indirect light, W/m2; G-buffer. Out: L,
// W/(m2 sr), and the normal, packed.
#import "shared/gbuffer/load.wgsl"

@group(1) @binding(11) var<storage, read> direct: array<vec4f>;
@group(1) @binding(12) var<storage, read_write> senders: array<vec4u>;
@group(1) @binding(13) var<storage, read> indirect: array<vec4f>;

override HAS_INDIRECT: bool = false;

@compute @workgroup_size(64, 4)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (any(id.xy >= view.size)) {
        return;
    }
    let index = id.y * view.size.x + id.x;
    let surface = load_surface(id.xy);
    var radiance = direct[index].rgb;
    if (HAS_INDIRECT) {
        radiance += indirect[index].rgb * gbuffer_brdf(surface).diffuse * INV_PI;
    }
    senders[index] = vec4u(bitcast<vec3u>(radiance), pack2x16snorm(octahedral_encode(surface.normal)));
}
