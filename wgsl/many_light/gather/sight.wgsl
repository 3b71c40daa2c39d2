// Rays from surfaces to VPLs. Errs where something stands within STOP_SHORT of a VPL.
#import "scene/surface.wgsl"
#import "scene/trace.wgsl"
#import "many_light/vpl/vpl.wgsl"
#import "many_light/gather/receiver.wgsl"

struct Sight {
    ray: Ray,
    limit: f32,   // in lengths of the ray's direction; 0 where one looks away from the other
}

fn sight_of(at: Receiver, vpl: Vpl) -> Sight {
    let offset = pixel_ray_offset(length(at.position - view.position));
    let start = offset_origin(at.position, at.geometric_normal, offset, vpl.position - at.position);
    let way = vpl.position - start;
    let faces = dot(way, at.normal) > 0.0 && dot(way, vpl.normal) < 0.0;
    return Sight(Ray(start, way), select(0.0, STOP_SHORT, faces));
}

// Returns 1 where nothing stands in the way, else 0. Two at once: lanes that have done one do not wait with the other.
fn see_two(a: Sight, b: Sight) -> vec2f {
    let found = trace_all(Rays(a.ray, a.limit, b.ray, b.limit, a.ray, 0.0));
    return vec2f(select(1.0, 0.0, found.occluded_a), select(1.0, 0.0, found.occluded_b));
}
