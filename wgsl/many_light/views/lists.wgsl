// One invocation shows the number of virtual point lights that a pixel gathers from: its class' lights in its cluster's
// list.
//
// In: light lists, G-buffer. Out: a number.
#import "many_light/gather/classes.wgsl"
#import "many_light/gather/clusters.wgsl"
#import "shared/gbuffer/load.wgsl"
#import "shared/upsample/grid.wgsl"
#import "scene/sequence.wgsl"

@group(1) @binding(11) var<storage, read> lists: array<u32>;
@group(1) @binding(12) var<storage, read_write> picture: array<vec4f>;
@group(1) @binding(19) var<uniform> params: Params;

struct Params {
    vpl_count: u32,
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let pixel = id.xy;
    if (any(pixel >= view.size)) {
        return;
    }
    let seen = load_distance(pixel);
    var count = 0u;
    if (seen > 0.0) {
        let tile = tile_of(pixel, view.size);
        var cluster = tile;
        if (SLICES > 1u) {
            cluster = tile * SLICES + slice_of(Slicing(lists[2u * tile], lists[2u * tile + 1u]), seen);
        }
        let class_number = class_of(pixel / STRIDE, sequence.index);
        let list = cluster * class_count() + class_number;
        let first = first_list(view.size) + list * words_per_class(params.vpl_count);
        for (var word = 0u; word < words_of_class(params.vpl_count, class_number); word += 1u) {
            count += countOneBits(lists[first + word]);
        }
    }
    picture[pixel.y * view.size.x + pixel.x] = vec4f(vec3f(f32(count)), 1.0);
}
