// The list of cells whose texels get rays of their own: slot << 16 | y << 8 | x, in cells.

override CELL: u32 = 4u;  // texels between rays

const OPEN_GROUP: u32 = 64u;  // threads of a workgroup over the texels of the list
const NO_CELL: u32 = 0xffffffffu;

struct OpenTexel {
    cell: u32,      // of the list, or NO_CELL
    inside: vec2u,  // texels from the cell's corner
}

// Returns what a thread works on.
fn open_texel(thread: u32, count: u32) -> OpenTexel {
    let cell = thread / (CELL * CELL);
    let inside = thread % (CELL * CELL);
    return OpenTexel(select(NO_CELL, cell, cell < count), vec2u(inside % CELL, inside / CELL));
}

struct OpenPlace {
    slot: u32,
    at: vec2u,  // texel of its map
}

fn open_place(cell: u32, inside: vec2u) -> OpenPlace {
    return OpenPlace(cell >> 16u, vec2u(cell & 0xffu, (cell >> 8u) & 0xffu) * CELL + inside);
}

fn pack_open_cell(slot: u32, cell: vec2u) -> u32 {
    return (slot << 16u) | (cell.y << 8u) | cell.x;
}
