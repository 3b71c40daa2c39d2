// The list of silhouette cells, whose blocks of texels get a ray each: slot << 16 | y << 8 | x, in cells of a map.
#import "many_light/ism/map.wgsl"

override RAY_SPACING: u32 = 4u;  // texels along the side of a cell

const REFINE_GROUP: u32 = 64u;  // threads of a workgroup; each takes a row of blocks of a cell

// Returns the number of blocks along the side of a cell.
fn blocks_per_side() -> u32 {
    return RAY_SPACING / BLOCK;
}

fn pack_silhouette_cell(slot: u32, cell: vec2u) -> u32 {
    return (slot << 16u) | (cell.y << 8u) | cell.x;
}

struct SilhouetteCell {
    slot: u32,
    corner: vec2u,  // its first texel in its map
}

fn unpack_silhouette_cell(code: u32) -> SilhouetteCell {
    return SilhouetteCell(code >> 16u, vec2u(code & 0xffu, (code >> 8u) & 0xffu) * RAY_SPACING);
}
