// One invocation adds up the irradiance of two bounces, W/m2.

@group(1) @binding(11) var<storage, read> before: array<vec4f>;
@group(1) @binding(12) var<storage, read> irradiance: array<vec4f>;
@group(1) @binding(13) var<storage, read_write> total: array<vec4f>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (id.x < arrayLength(&total)) {
        total[id.x] = vec4f(before[id.x].rgb + irradiance[id.x].rgb, irradiance[id.x].a);
    }
}
