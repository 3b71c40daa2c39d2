// One invocation sums the statistics of a tile's threads, and averages them over the frames of a still picture.
//
// In: statistics of each thread. Out: a tile's record. Exact.
#import "many_light/gather/ray_record.wgsl"

@group(1) @binding(11) var<storage, read> statistics: array<vec4f>;
@group(1) @binding(12) var<storage, read_write> tiles: array<RayTile>;
@group(1) @binding(19) var<uniform> params: Params;

struct Params {
    size: vec2u,  // tiles
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (any(id.xy >= params.size)) {
        return;
    }
    // Sum over the threads of all classes.
    var sum = vec4f(0.0);
    for (var k = 0u; k < class_count(); k += 1u) {
        let first = first_thread(id.xy, k);
        let start = first.y * params.size.x * GROUP_X + first.x;
        for (var x = 0u; x < GROUP_X; x += 1u) {
            sum += statistics[start + x];
        }
    }
    // Average over frames. Frame 0 starts over.
    let count = max(sum.x, 1.0);
    let index = id.y * params.size.x + id.x;
    let frame = f32(sequence.still + 1u);
    let before = tiles[index];
    let goes_on = sequence.still > 0u;
    let mean = select(0.0, before.radiance, goes_on);
    let one_ray = select(0.0, before.one_ray, goes_on);
    let rays = select(0.0, before.rays, goes_on);
    let apart = sum.y / count - mean;
    tiles[index] = RayTile(
        mean + apart / frame, select(0.0, before.squares, goes_on) + apart * (apart - apart / frame),
        one_ray + (sum.z / count - one_ray) / frame, rays + (sum.w / (count * count) - rays) / frame, sum.x);
}
