// One invocation shows the flux of a virtual point light as a square of 3 x 3 pixels, W.
//
// Lights behind surfaces are shown, too. Where several overlap, the GPU determines which one is shown.
#import "scene/info.wgsl"
#import "many_light/vpl/table.wgsl"

@group(1) @binding(11) var<storage, read_write> picture: array<vec4f>;
@group(1) @binding(19) var<uniform> params: Params;

struct Params {
    vpl_count: u32,
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (id.x >= params.vpl_count) {
        return;
    }
    let v = load_vpl(id.x);
    let clip = view.clip_from_world * vec4f(v.position, 1.0);
    if (clip.w <= 0.0 || any(abs(clip.xy) > vec2f(clip.w))) {
        return;
    }
    let pixel = vec2i((clip.xy / clip.w * vec2f(0.5, -0.5) + 0.5) * vec2f(view.size));
    for (var y = -1; y <= 1; y += 1) {
        for (var x = -1; x <= 1; x += 1) {
            let at = pixel + vec2i(x, y);
            if (all(at >= vec2i(0)) && all(at < vec2i(view.size))) {
                picture[u32(at.y) * view.size.x + u32(at.x)] = vec4f(v.flux, 1.0);
            }
        }
    }
}
