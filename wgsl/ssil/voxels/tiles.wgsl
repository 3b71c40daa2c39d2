// One workgroup voxelizes one tile of the cells of a large triangle, from the list of `voxelize.wgsl`.
//
// In: the scene, its solid triangles, the depth range, the list. Out: cells. Exact.
#import "ssil/voxels/triangle.wgsl"

@group(1) @binding(19) var<uniform> params: Grid;

const GROUP: u32 = 32u;

@compute @workgroup_size(GROUP)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) thread: u32) {
    // Load the triangle and the tile.
    let word = params.list + 1u + TILE_WORDS * group.x;
    let place = atomicLoad(&cells[word + 2u]);
    let tile = TILE * vec2u(place & 0xffffu, place >> 16u);
    let f = footprint_of(atomicLoad(&cells[word]), atomicLoad(&cells[word + 1u]), params);
    let t = lines_of(f);
    let cut = atomicLoad(&cells[word + 3u]) != 0u;
    // Voxelize its cells, a row of the tile after the other.
    for (var k = thread; k < TILE * TILE; k += GROUP) {
        let at = tile + vec2u(k % TILE, k / TILE);
        if (all(at >= f.low) && all(at < f.high)) {
            voxelize_cell(f, t, at, cut, params);
        }
    }
}
