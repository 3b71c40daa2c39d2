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

// Returns the visibility along two rays, 1 or 0 each. Both are traced in one loop, so a SIMD lane that finishes its
// first ray does not wait for other lanes.
fn trace_shadow_rays(a: ShadowRay, b: ShadowRay) -> vec2f {
    let found = trace_all(Rays(a.ray, a.limit, b.ray, b.limit, a.ray, 0.0));
    return vec2f(select(1.0, 0.0, found.occluded_a), select(1.0, 0.0, found.occluded_b));
}
