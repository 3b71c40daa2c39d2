// Each invocation gives a sorted triangle its next key: the high bits of its Morton code, or the number of its tree.
@group(1) @binding(0) var<storage, read> keys: array<u32>;  // by triangle
@group(1) @binding(1) var<storage, read_write> pairs: array<vec2u>;

@compute @workgroup_size(256)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (id.x < arrayLength(&pairs)) {
        pairs[id.x].x = keys[pairs[id.x].y];
    }
}
