// One invocation merges this frame's update of a cell into its running mean, and frees a cell that no ray has hit for
// long.
//
// E += (x - E) / k, k = min(updates + 1, MOST_UPDATES). In: updates, W/m2, votes. Out: means, W/m2; the votes are 0
// again. A change of the scene starts all means anew, so they do not lag.
#import "shared/radiance_cache/cells.wgsl"

@group(1) @binding(22) var<storage, read_write> table: array<u32>;  // per cell: check, 0 if free; vote
@group(1) @binding(25) var<storage, read_write> cells: array<Cell>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (id.x >= arrayLength(&cells) || table[2u * id.x] == 0u) {
        return;
    }
    var cell = cells[id.x];
    var updates = updates_of(cell.state);
    var unused = ((cell.state >> 8u) & 255u) + 1u;
    if (table[2u * id.x + 1u] != 0u) {
        cell.drawn = select(0u, cell.drawn, updates > 0u) + 1u;
        updates = min(updates + 1u, MOST_UPDATES);
        let update = select(vec3f(0.0), cell.update, is_finite(cell.update));
        // The first update replaces what is there.
        let before = select(vec3f(0.0), cell.irradiance, updates > 1u);
        cell.irradiance = before + (update - before) / f32(updates);
        unused = 0u;
        table[2u * id.x + 1u] = 0u;
    }
    if (unused > OLDEST) {
        updates = 0u;
        table[2u * id.x] = 0u;
    }
    cell.state = updates | (unused << 8u) | (cache_scene.version << 16u);
    cells[id.x] = cell;
}
