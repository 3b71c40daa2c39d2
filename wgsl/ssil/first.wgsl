// One invocation turns a pixel of the G-buffer into a surfel of the finest level.
//
// In: G-buffer. Out: surfels, 0 where nothing is seen.
#import "ssil/pixel_surfel.wgsl"

@group(1) @binding(11) var surfels: texture_storage_2d<rgba32uint, write>;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (any(id.xy >= view.size)) {
        return;
    }
    let seen = load_distance(id.xy);
    var texel = vec4u(0u);
    if (seen > 0.0) {
        let facing = facing_side();
        texel = pack_surfel(pixel_surfel(id.xy, load_surface(id.xy), seen, facing), facing);
    }
    textureStore(surfels, id.xy, texel);
}
