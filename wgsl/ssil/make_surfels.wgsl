// One invocation converts a pixel of the G-buffer to a surfel of level 0.
//
// In: G-buffer. Out: surfels, 0 where there is no surface.
#import "ssil/pixel_surfel.wgsl"

@group(1) @binding(11) var surfels: texture_storage_2d<rgba32uint, write>;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (any(id.xy >= view.size)) {
        return;
    }
    let hit_distance = load_distance(id.xy);
    var texel = vec4u(0u);
    if (hit_distance > 0.0) {
        let facing = facing_side();
        texel = pack_surfel(pixel_surfel(id.xy, load_surface(id.xy), hit_distance, facing), facing);
    }
    textureStore(surfels, id.xy, texel);
}
