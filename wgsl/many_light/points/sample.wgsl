// One invocation places a point on the scene's surfaces, in proportion to their area.
//
// In: cumulative areas, scene. Out: points as `many_light/points/table.wgsl` reads them. Exact.
#import "many_light/points/draw.wgsl"

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let index = id.y * groups.x * 64u + id.x;
    let count = arrayLength(&points) / 2u;
    if (index < count) {
        store_point(index, index, count, 0u);
    }
}
