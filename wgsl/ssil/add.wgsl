// One invocation adds up the irradiance of two bounces, W/m2.

@group(1) @binding(11) var<storage, read> before: array<vec4f>;
@group(1) @binding(12) var<storage, read> irradiance: array<vec4f>;
@group(1) @binding(13) var<storage, read_write> total: array<vec4f>;

const ROW: u32 = 4096u;  // threads along x: large pictures need more workgroups than a dispatch has along one axis

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let index = id.y * ROW + id.x;
    if (index < arrayLength(&total)) {
        total[index] = vec4f(before[index].rgb + irradiance[index].rgb, irradiance[index].a);
    }
}
