// One invocation converts a pixel's irradiance to reflected radiance: L = rho E / pi + L_coat.
//
// In: G-buffer; irradiance E, W/m2, of what coats transmit; L_coat over coat_tint(), W/(m2 sr). Out: L, W/(m2 sr).
// Exact.
#import "shared/gbuffer/load.wgsl"
#import "common/coat.wgsl"

override LOBES: u32 = 0u;  // 0: there are no coats

@group(1) @binding(11) var<storage, read> irradiance: array<vec4f>;
@group(1) @binding(12) var<storage, read_write> radiance: array<vec4f>;
@group(1) @binding(13) var<storage, read> coat: array<vec4f>;

@compute @workgroup_size(64, 4)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (any(id.xy >= view.size)) {
        return;
    }
    let index = id.y * view.size.x + id.x;
    let surface = load_surface(id.xy);
    let brdf = gbuffer_brdf(surface);
    var reflected = irradiance[index].rgb * brdf.diffuse * INV_PI;
    if (LOBES > 0u && brdf.glossy) {
        reflected += coat[index].rgb * coat_tint(brdf, surface.normal, -pixel_ray(id.xy).direction);
    }
    radiance[index] = vec4f(select(vec3f(0.0), reflected, irradiance[index].w > 0.0), 1.0);
}
