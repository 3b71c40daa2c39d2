// Look-ups in the radiance cache.
#import "shared/radiance_cache/cells.wgsl"

@group(1) @binding(22) var<storage, read> table: array<u32>;  // per cell: check, 0 if free; vote

// Returns the cell of a key, or NO_CELL.
fn find_cell(key: CellKey) -> u32 {
    let cells = arrayLength(&table) / 2u;
    for (var k = 0u; k < 2u * BUCKET; k += 1u) {
        let place = place_of(key, k, cells);
        if (table[2u * place] == key.check) {
            return place;
        }
    }
    return NO_CELL;
}
