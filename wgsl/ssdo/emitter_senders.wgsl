// One invocation adds the light of emitters to a sender of a deeper layer or of a further camera, with few shadow rays
// (`deferred/emitters/estimate.wgsl`).
//
// L += rho / pi int L_e cos V. In: G-buffer of the source, emitters, scene. Out: L, W/(m2 sr). Noisy, and dark where
// coats reflect, as in `ssdo/senders.wgsl`.
#import "deferred/emitters/estimate.wgsl"
#import "shared/gbuffer/read.wgsl"
#import "scene/sequence.wgsl"
#import "shared/upsample/grid.wgsl"

override OUTWARD: bool = false;  // light the counter-clockwise side of surfaces, not the visible side

@group(1) @binding(12) var<storage, read_write> senders: array<vec4u>;
@group(1) @binding(19) var<uniform> params: Params;

struct Params {
    first: u32,  // index of the source's first sender
    seed: u32,
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (any(id.xy >= grid_size())) {
        return;
    }
    let pixel = id.xy * STRIDE;
    let surface = load_surface(pixel);
    let seen = load_distance(pixel);
    if (seen <= 0.0 || (surface.flags & GBUFFER_UNLIT) != 0u) {
        return;
    }
    let ray = pixel_ray(pixel);
    let faces = dot(surface.geometric_normal, ray.direction) < 0.0;
    let normal = select(surface.normal, -surface.normal, OUTWARD && !faces);
    let r = receiver(
        ray.origin + ray.direction * seen, normal, surface.geometric_normal,
        brdf_lambert(gbuffer_brdf(surface).diffuse), normal);
    let found = sum_of(
        scattered_from_emitters(
            r, ray_offset(r.geometric_normal, pixel_terms(r.position)), id.xy, sequence.index, params.seed + params.first));
    let index = params.first + id.y * grid_size().x + id.x;
    let sender = senders[index];
    let sum = bitcast<vec3f>(sender.rgb) + select(vec3f(0.0), found, is_finite(found));
    senders[index] = vec4u(bitcast<vec3u>(sum), sender.w);
}
