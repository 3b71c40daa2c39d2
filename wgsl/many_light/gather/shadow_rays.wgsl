// Shadow rays from receivers to VPLs. Errs bright where a blocker stands within STOP_SHORT of a VPL.
#import "scene/surface.wgsl"
#import "scene/trace.wgsl"
#import "many_light/vpl/vpl.wgsl"
#import "many_light/gather/receiver.wgsl"

struct ShadowRay {
    ray: Ray,
    limit: f32,   // in lengths of the ray's direction; 0 where receiver or VPL faces away, and no ray is traced
}

fn shadow_ray(at: Receiver, vpl: Vpl) -> ShadowRay {
    let offset = ray_offset(at.geometric_normal, pixel_terms(at.position));
    let start = offset_origin(at.position, at.geometric_normal, offset, vpl.position - at.position);
    let way = vpl.position - start;
    let faces = dot(way, at.normal) > 0.0 && dot(way, vpl.normal) < 0.0;
    return ShadowRay(Ray(start, way), select(0.0, STOP_SHORT, faces));
}

// The light that arrives along two rays, as shares by colour.
struct PassedPair {
    a: vec3f,
    b: vec3f,
}

// Returns the visibility along two rays: 0, or what see-through surfaces pass, 1 without. Both are traced in one loop, so
// a SIMD lane that finishes its first ray does not wait for other lanes.
fn trace_shadow_rays(a: ShadowRay, b: ShadowRay) -> PassedPair {
    let found = trace_all(Rays(a.ray, a.limit, b.ray, b.limit, a.ray, 0.0, 0u, 0u));
    return PassedPair(
        select(found.tint_a, vec3f(0.0), found.occluded_a), select(found.tint_b, vec3f(0.0), found.occluded_b));
}
