// One invocation makes a cell of the next level: the AND of four finer cells, slice by slice (section 4). In, out:
// voxels. Errs bright: omits occluders thinner than a cell, and never blocks free space.

override SLICES: u32 = 128u;

struct Params {
    finer_size: vec2u,  // cells
    size: vec2u,
}

@group(1) @binding(11) var<storage, read> finer: array<u32>;
@group(1) @binding(12) var<storage, read_write> voxels: array<u32>;
@group(1) @binding(19) var<uniform> params: Params;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (any(id.xy >= params.size)) {
        return;
    }
    let words = SLICES / 32u;
    let index = (id.y * params.size.x + id.x) * words;
    for (var word = 0u; word < words; word += 1u) {
        var common_bits = 0xffffffffu;
        for (var k = 0u; k < 4u; k += 1u) {
            let cell = min(2u * id.xy + vec2u(k & 1u, k >> 1u), params.finer_size - 1u);
            common_bits &= finer[(cell.y * params.finer_size.x + cell.x) * words + word];
        }
        voxels[index + word] = common_bits;
    }
}
