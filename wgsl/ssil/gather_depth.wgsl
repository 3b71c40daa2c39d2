// One invocation gathers light with visibility by a march through the picture's depths. Only the nearest surfaces are
// known; their assumed thickness is THICKNESS times their depth. Errs dark behind thinner surfaces, bright behind
// thicker ones and where a hidden surface occludes.
#import "ssil/gather.wgsl"

const STEPS: u32 = 8u;

// Thickness of every surface, as a share of its depth. tools/README.md, "Constants".
const THICKNESS: f32 = 0.1;
// A surface occludes a ray that passes behind it by more than this share of its depth, which is above a surface's slope
// within a pixel. tools/README.md, "Constants".
const BEHIND: f32 = 0.02;
// Pixels skipped at each end: rounding may hit the end itself, 0.5, and its neighbour, 1.
const END_PIXELS: f32 = 1.5;

const DRAWS_PER_TEST: u32 = 1u;

fn prepare(start: Endpoint) {}

fn visibility(start: Endpoint, end: Endpoint, number: u32) -> vec3f {
    let jitter = fract(f32(number) * 0.618034);
    let reach = vec2f(abs(end.pixel - start.pixel));
    let gap = END_PIXELS / max(max(reach.x, reach.y), 2.0 * END_PIXELS);
    let parallel = view.orthographic != 0u;
    let depths = vec2f(dot(start.position, view.forward), dot(end.position, view.forward));
    let along = select(1.0 / depths, depths, parallel);
    var visible = 1.0;
    for (var k = 0u; k < STEPS; k += 1u) {
        let t = gap + (f32(k) + jitter) * (1.0 - 2.0 * gap) / f32(STEPS);
        let texel = textureLoad(surfels, vec2u(round(mix(vec2f(start.pixel), vec2f(end.pixel), t))));
        let at = mix(along.x, along.y, t);
        let depth = select(1.0 / at, at, parallel);
        let off = depth / max(dot(surfel_position(texel), view.forward), 1e-30) - 1.0;
        visible = select(visible, 0.0, !is_empty(texel) && off > BEHIND && off < BEHIND + THICKNESS);
    }
    return vec3f(visible);
}

@compute @workgroup_size(8, 8)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) thread: vec3u) {
    gather(group, thread);
}

@compute @workgroup_size(LIST_GROUP)
fn listed(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    gather_unrepresented(id.x, groups.x * LIST_GROUP);
}
