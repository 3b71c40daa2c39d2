// The list of cells whose blocks of texels get rays of their own: slot << 16 | y << 8 | x, in cells.
#import "many_light/ism/map.wgsl"

override CELL: u32 = 4u;  // texels between rays

const OPEN_GROUP: u32 = 64u;  // threads of a workgroup, each over a row of blocks of a cell

fn open_rows() -> u32 {
    return CELL / BLOCK;
}

fn pack_open_cell(slot: u32, cell: vec2u) -> u32 {
    return (slot << 16u) | (cell.y << 8u) | cell.x;
}

struct OpenCell {
    slot: u32,
    corner: vec2u,  // texel of its map
}

fn unpack_open_cell(cell: u32) -> OpenCell {
    return OpenCell(cell >> 16u, vec2u(cell & 0xffu, (cell >> 8u) & 0xffu) * CELL);
}
