// One invocation gathers light with a ray to each sample. Errs as `gather.wgsl` does.
#import "ssil/gather.wgsl"
#import "scene/surface.wgsl"
#import "scene/trace.wgsl"

// A ray costs as much as 2 to 3 marches. 160x90, 16 frames, relMSE with 1 and 4: Cornell point .0124, .0128, area .0090,
// .0092, Sponza (a) .58, .58; one frame: .079, .096; .044, .049; 1.37, 1.47.
const DRAWS_PER_TEST: u32 = 4u;

fn prepare(start: Endpoint) {}

fn visibility(start: Endpoint, end: Endpoint, number: u32) -> vec3f {
    let way = end.position - start.position;
    // Surfels have no geometric normal, so both ends move along the ray, by 20 offsets: enough down to 3 degrees above
    // the surface. Errs bright: the ray misses blockers within that distance.
    let offset = ray_offset(ANY_NORMAL, pixel_terms(view.position + start.position));
    let gap = normalize_or(way, vec3f(0.0)) * (20.0 * offset);
    let shadow = Ray(view.position + start.position + gap, way - 2.0 * gap);
    let found = trace_shadow(shadow, 1.0);
    return select(found.tint_a, vec3f(0.0), found.occluded_a);
}

@compute @workgroup_size(8, 8)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) thread: vec3u) {
    gather(group, thread);
}

@compute @workgroup_size(LIST_GROUP)
fn listed(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    gather_unrepresented(id.x, groups.x * LIST_GROUP);
}
