// One invocation adds the irradiance from surfaces that no pixel shows to that of a pixel of the first level.
//
// In: both, W/m2. Out: their sum; w stays.

@group(1) @binding(11) var<storage, read> offscreen: array<vec4f>;
@group(1) @binding(12) var<storage, read_write> irradiance: array<vec4f>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (id.x < arrayLength(&irradiance)) {
        irradiance[id.x] += vec4f(offscreen[id.x].rgb, 0.0);
    }
}
