// How workgroups are laid out over the list of seen tiles: in rows, since a dispatch takes 65535 along each axis.

const TILE_ROW: u32 = 32768u;  // tiles
