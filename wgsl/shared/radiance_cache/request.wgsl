// Requests the cells of points that rays have hit: finds or adds a point's cell, lists it, and votes for the point that
// updates it.
#import "shared/radiance_cache/cells.wgsl"
#import "shared/radiance_cache/votes.wgsl"

@group(1) @binding(22) var<storage, read_write> table: array<atomic<u32>>;     // per cell: check, 0 if free; vote
@group(1) @binding(23) var<storage, read_write> requested: array<atomic<u32>>; // x, y, z workgroups; cells; the cells

const LIST_HEADER: u32 = 4u;
const UPDATE_GROUP: u32 = 64u;  // threads of a workgroup that updates cells
// Attempts to take a free cell: the exchange may fail without a reason.
const ATTEMPTS: u32 = 4u;

// Returns the cell of a key, added if it is new; NO_CELL if its buckets are full.
fn claim_cell(key: CellKey) -> u32 {
    let cells = arrayLength(&table) / 2u;
    for (var k = 0u; k < 2u * BUCKET; k += 1u) {
        let place = place_of(key, k, cells);
        if (atomicLoad(&table[2u * place]) == key.check) {
            return place;
        }
    }
    for (var k = 0u; k < 2u * BUCKET; k += 1u) {
        let place = place_of(key, k, cells);
        for (var attempt = 0u; attempt < ATTEMPTS; attempt += 1u) {
            let taken = atomicCompareExchangeWeak(&table[2u * place], 0u, key.check);
            if (taken.exchanged || taken.old_value == key.check) {
                return place;
            }
            if (taken.old_value != 0u) {
                break;
            }
        }
    }
    return NO_CELL;
}

// Requests the cell of a key for hit number `hit` of this frame; returns the cell, or NO_CELL.
fn request_cell(key: CellKey, hit: u32, multiplier: u32) -> u32 {
    let cell = claim_cell(key);
    if (cell != NO_CELL && atomicMax(&table[2u * cell + 1u], vote_of(hit, multiplier)) == 0u) {
        // The first vote: list the cell.
        let slot = atomicAdd(&requested[3], 1u);
        atomicStore(&requested[LIST_HEADER + slot], cell);
        atomicMax(&requested[0], slot / UPDATE_GROUP + 1u);
        atomicStore(&requested[1], 1u);
        atomicStore(&requested[2], 1u);
    }
    return cell;
}
