// One invocation converts a pixel's irradiance to reflected radiance: L = rho E / pi.
//
// In: G-buffer, irradiance E, W/m2. Out: L, W/(m2 sr). Exact for the diffuse part; coats are left out.
#import "shared/gbuffer/load.wgsl"

@group(1) @binding(11) var<storage, read> irradiance: array<vec4f>;
@group(1) @binding(12) var<storage, read_write> radiance: array<vec4f>;

@compute @workgroup_size(64, 4)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (any(id.xy >= view.size)) {
        return;
    }
    let index = id.y * view.size.x + id.x;
    let reflectance = gbuffer_brdf(load_surface(id.xy)).diffuse * INV_PI;
    radiance[index] = vec4f(irradiance[index].rgb * select(vec3f(0.0), reflectance, irradiance[index].w > 0.0), 1.0);
}
