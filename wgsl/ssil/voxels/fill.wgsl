// One invocation fills a cell: slices behind an odd number of solid boundaries, and slices that shells pass.
//
// In: cells of `voxelize.wgsl`, boundaries first. Out: the finest grid. Errs where a mesh is not closed: parity counts
// only the surfaces in front.

override SLICES: u32 = 128u;
override HAS_SOLIDS: bool = true;
override HAS_SHELLS: bool = true;

const ROW: u32 = 4096u;  // threads along x: fine grids exceed a dispatch's workgroups along one axis

@group(1) @binding(11) var<storage, read> cells: array<u32>;
@group(1) @binding(12) var<storage, read_write> voxels: array<u32>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let words = SLICES / 32u;
    let first = (id.y * ROW + id.x) * words;
    if (first >= arrayLength(&voxels)) {
        return;
    }
    var parity = 0u;
    for (var word = first; word < first + words; word += 1u) {
        var bits = 0u;
        if (HAS_SOLIDS) {
            // Replace each bit by the parity of all bits up to it.
            bits = cells[word];
            bits ^= bits << 1u;
            bits ^= bits << 2u;
            bits ^= bits << 4u;
            bits ^= bits << 8u;
            bits ^= bits << 16u;
            bits ^= parity;
            parity = select(0u, 0xffffffffu, (bits >> 31u) != 0u);
        }
        if (HAS_SHELLS) {
            bits |= cells[select(0u, arrayLength(&voxels), HAS_SOLIDS) + word];
        }
        voxels[word] = bits;
    }
}
