// The gathering of light with visibility by a march through the depths of the picture, which knows nothing of what is
// behind the nearest surfaces: these are taken to be THICKNESS of their depth thick. Errs dark behind thinner ones, and
// bright where something hidden hides.
#import "ssil/gather.wgsl"

const STEPS: u32 = 8u;

// Both chosen: share of the depth; cells.
const THICKNESS: f32 = 0.1;
const END_CELLS: f32 = 1.5;
// Of the depth, what a ray must be behind a surface to be hidden. Chosen.
const BEHIND: f32 = 0.02;

fn prepare(start: Place) {}

fn visibility(start: Place, end: Place, number: u32) -> f32 {
    let jitter = fract(f32(number) * 0.618034);
    let reach = vec2f(abs(end.pixel - start.pixel));
    let gap = END_CELLS / max(max(reach.x, reach.y), 2.0 * END_CELLS);
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
    return visible;
}

@compute @workgroup_size(8, 8)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) thread: vec3u) {
    gather(group, thread);
}

@compute @workgroup_size(LIST_GROUP)
fn listed(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    gather_unrepresented(id.x, groups.x * LIST_GROUP);
}
