// One invocation fills a cell: where an odd number of surfaces of closed meshes lies before a slice, or in slices that
// other surfaces pass. In: crossings, shells. Out: the grid of the first level.

override BITS: u32 = 128u;
override HAS_SOLIDS: bool = true;
override HAS_SHELLS: bool = true;

@group(1) @binding(11) var<storage, read> crossings: array<u32>;
@group(1) @binding(12) var<storage, read> shells: array<u32>;
@group(1) @binding(13) var<storage, read_write> voxels: array<u32>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let words = BITS / 32u;
    let first = id.x * words;
    if (first >= arrayLength(&voxels)) {
        return;
    }
    var parity = 0u;
    for (var word = first; word < first + words; word += 1u) {
        var bits = 0u;
        if (HAS_SOLIDS) {
            // Each bit becomes the parity of all up to it.
            bits = crossings[word];
            bits ^= bits << 1u;
            bits ^= bits << 2u;
            bits ^= bits << 4u;
            bits ^= bits << 8u;
            bits ^= bits << 16u;
            bits ^= parity;
            parity = select(0u, 0xffffffffu, (bits >> 31u) != 0u);
        }
        if (HAS_SHELLS) {
            bits |= shells[word];
        }
        voxels[word] = bits;
    }
}
