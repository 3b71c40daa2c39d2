// One invocation voxelizes a triangle of few cells; it divides a larger one into tiles of cells and lists them for
// `tiles.wgsl`, so that no invocation works long while others wait.
//
// In: the scene, its solid triangles, the depth range. Out: cells, and the list of (triangle, tile) pairs. Exact: both
// ways set the same bits.
#import "ssil/voxels/triangle.wgsl"

override LARGE: u32 = 200u;  // most cells of a triangle that one invocation voxelizes
override MOST_TILES: u32 = 65535u;  // entries of the list

struct Params {
    size: vec2u,     // as in Grid
    cell: f32,
    shells: u32,
    list: u32,
    first: u32,      // entry of the index buffer
    triangles: u32,
    slot: u32,       // of the first instance
    count: u32,      // triangles of all instances
}

@group(1) @binding(19) var<uniform> params: Params;

const ROW: u32 = 4096u;   // threads along x: large scenes exceed a dispatch's workgroups along one axis
const TILE_MARGIN: f32 = 1.02;  // of a shell: its margin, wider by the rounding of the test

fn grid() -> Grid {
    return Grid(params.size, params.cell, params.shells, params.list);
}

// Returns whether a triangle may pass cells of a tile: none of its edges has the whole tile on its outer side.
fn passes_tile(f: Footprint, t: Lines, tile: vec2u) -> bool {
    let low = vec2f(max(tile * TILE, f.low)) + 0.5;
    let high = vec2f(min((tile + 1u) * TILE, f.high)) - 0.5;
    // Take the corner that lies farthest inside of each edge.
    let slopes = transpose(t.lines);
    let off = select(low.xxx, high.xxx, slopes[0] > vec3f(0.0)) * slopes[0]
        + select(low.yyy, high.yyy, slopes[1] > vec3f(0.0)) * slopes[1] + slopes[2];
    return all(off + TILE_MARGIN * t.wider >= vec3f(0.0));
}

// Voxelizes all cells of a tile, for the case that the list is full.
fn voxelize_tile(f: Footprint, t: Lines, tile: vec2u) {
    let low = max(tile * TILE, f.low);
    let size = min((tile + 1u) * TILE, f.high) - low;
    for (var k = 0u; k < size.x * size.y; k += 1u) {
        voxelize_cell(f, t, low + vec2u(k % size.x, k / size.x), true, grid());
    }
}

// Lists the tiles of a triangle.
fn list_tiles(f: Footprint, t: Lines, entry: u32, slot: u32) {
    let low = f.low / TILE;
    let size = (f.high + TILE - 1u) / TILE - low;
    let tiles = size.x * size.y;
    // Count them and reserve their entries; a full list keeps its count, which therefore never overflows.
    var count = 0u;
    for (var k = 0u; k < tiles; k += 1u) {
        count += select(0u, 1u, passes_tile(f, t, low + vec2u(k % size.x, k / size.x)));
    }
    let list = params.list;
    var place = MOST_TILES;
    if (atomicLoad(&cells[list]) < MOST_TILES) {
        place = atomicAdd(&cells[list], count);
    }
    // Store them.
    for (var k = 0u; k < tiles; k += 1u) {
        let tile = low + vec2u(k % size.x, k / size.x);
        if (!passes_tile(f, t, tile)) {
            continue;
        }
        if (place < MOST_TILES) {
            let word = list + 1u + TILE_WORDS * place;
            atomicStore(&cells[word], entry);
            atomicStore(&cells[word + 1u], slot);
            atomicStore(&cells[word + 2u], tile.x | (tile.y << 16u));
            atomicStore(&cells[word + 3u], select(0u, 1u, HAS_CUTS));
        } else {
            voxelize_tile(f, t, tile);
        }
        place += 1u;
    }
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let number = id.y * ROW + id.x;
    if (number >= params.count) {
        return;
    }
    let slot = params.slot + number / params.triangles;
    let entry = params.first + 3u * (number % params.triangles);
    let f = footprint_of(entry, slot, grid());
    let count = cell_count(f);
    if (count == 0u) {
        return;
    }
    let t = lines_of(f);
    if (count > LARGE) {
        list_tiles(f, t, entry, slot);
        return;
    }
    let width = f.high.x - f.low.x;
    for (var k = 0u; k < count; k += 1u) {
        voxelize_cell(f, t, f.low + vec2u(k % width, k / width), true, grid());
    }
}
