// One invocation shows the rejected share of a pixel's history, 0 to 1.
#import "scene/info.wgsl"

@group(1) @binding(11) var<storage, read> rejected: array<f32>;
@group(1) @binding(12) var<storage, read_write> picture: array<vec4f>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (id.x < view.size.x && id.y < view.size.y) {
        let pixel = id.y * view.size.x + id.x;
        picture[pixel] = vec4f(vec3f(rejected[pixel]), 1.0);
    }
}
