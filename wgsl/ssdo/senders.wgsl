// One invocation lights a pixel of a deeper layer or of a further camera: L = rho / pi (E_sky V + sum_i E_i cos_i V_i).
// Every STRIDE-th pixel of every STRIDE-th row represents its neighbours, too.
//
// V_i comes from filtered shadow maps; V of the sky from `search.wgsl` for a coarser grid, blurred and upsampled. In:
// G-buffer of the source, lights, V of the sky. Out: L, W/(m2 sr), and the normal, packed. Errs blurry, by STRIDE, and
// dark where coats reflect: coats are left out, since their reflection depends on the receiver.
#import "shared/gbuffer/load.wgsl"
#import "deferred/direct/lighting.wgsl"
#import "deferred/environment/ambient.wgsl"
#import "shared/upsample/grid.wgsl"
#import "shared/upsample/gbuffer_surface.wgsl"
#import "shared/upsample/once.wgsl"

override OUTWARD: bool = false;  // light the counter-clockwise side of surfaces, not the visible side

@group(1) @binding(12) var<storage, read_write> senders: array<vec4u>;
@group(1) @binding(19) var<uniform> params: Params;

struct Params {
    first: u32,  // index of the source's first sender
}

fn coarse_surface(pixel: vec2u) -> GuideSurface {
    return gbuffer_guide_surface(pixel * COARSE_STRIDE, OUTWARD);
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (any(id.xy >= grid_size())) {
        return;
    }
    let index = id.y * grid_size().x + id.x;
    let pixel = id.xy * STRIDE;
    let surface = load_surface(pixel);
    let seen = load_distance(pixel);
    let lit = seen > 0.0 && (surface.flags & GBUFFER_UNLIT) == 0u;
    let ray = pixel_ray(pixel);
    let position = ray.origin + ray.direction * seen;
    let faces = dot(surface.geometric_normal, ray.direction) < 0.0;
    let normal = select(surface.normal, -surface.normal, OUTWARD && !faces);
    let albedo = select(vec3f(0.0), gbuffer_brdf(surface).diffuse, lit);
    var irradiance = ambient_irradiance(normal);
    if (HAS_ENVIRONMENT) {
        let size = (view.size + COARSE_STRIDE - 1u) / COARSE_STRIDE;
        let own = GuideSurface(position - view.position, normal, lit);
        let per_metre = pixels_per_metre(own.position) / f32(COARSE_STRIDE);
        irradiance *= upsampled_once(pixel, own, size, per_metre);
    }
    let count = load_light_count();
    for (var number = 0u; number < count; number += 1u) {
        let light = load_light(number);
        let incident = light_at(light, position);
        let arriving = incident.irradiance * max(dot(normal, incident.direction), 0.0);
        if (max3(arriving) > 0.0) {
            irradiance +=
                arriving * shadow_filter(light, count, position, surface.geometric_normal, incident.direction);
        }
    }
    let code = pack2x16snorm(octahedral_encode(normal));
    senders[params.first + index] = vec4u(bitcast<vec3u>(irradiance * albedo * INV_PI), code);
}
