// One invocation sums up the light of some of its class' VPLs for four pixels, with a ray to each.
//
// In: G-buffer, VPLs, scene. Out: irradiance, W/m2, and what coats reflect, added to by each pass. Errs where
// something stands within STOP_SHORT of a VPL.
#import "gather/gather.wgsl"
#import "scene/surface.wgsl"

@group(1) @binding(19) var<uniform> params: Params;

struct Params {
    // Of the words of each class. A pass takes one: drivers may cut the loops of an invocation and of those that run in
    // step with it at 65535 iterations (llvmpipe of Mesa 22), and each VPL takes four rays of about a hundred.
    first: u32,
}

fn visibility(slot: u32, vpl: Vpl, at: Four) -> vec4f {
    return vec4f(
        sees(at.a.position, at.a.normal, vpl), sees(at.b.position, at.b.normal, vpl),
        sees(at.c.position, at.c.normal, vpl), sees(at.d.position, at.d.normal, vpl));
}

fn sees(position: vec3f, normal: vec3f, vpl: Vpl) -> f32 {
    // A pixel's point is off its surface by the rounding of its distance and of the scene's coordinates.
    let size = max3(abs(scene.centre)) + scene.radius + length(position - view.position);
    let start = position + normal * (POSITION_ULPS * size);
    let way = vpl.position - start;
    let faces = dot(way, normal) > 0.0 && dot(way, vpl.normal) < 0.0;
    let shadow = Ray(start, way);
    let found = trace_all(Rays(shadow, select(0.0, STOP_SHORT, faces), shadow, 0.0, shadow, 0.0));
    return select(1.0, 0.0, found.occluded_a);
}

@compute @workgroup_size(GROUP_X, GROUP_Y)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) thread: vec3u) {
    gather(group, thread, params.first, 1u);
}
