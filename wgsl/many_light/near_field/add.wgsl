// One invocation adds the near field's irradiance to the VPLs': E = E_far + E_near.
//
// In: both, W/m2, (r, g, b, depth of `shared/denoise/plane.wgsl`). Out: their sum; the depth is that of E_far.
#import "scene/info.wgsl"

@group(1) @binding(11) var<storage, read> gathered: array<vec4f>;
@group(1) @binding(12) var<storage, read> near: array<vec4f>;
@group(1) @binding(13) var<storage, read_write> irradiance: array<vec4f>;

@compute @workgroup_size(64, 4)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (any(id.xy >= view.size)) {
        return;
    }
    let index = id.y * view.size.x + id.x;
    irradiance[index] = gathered[index] + vec4f(near[index].rgb, 0.0);
}
