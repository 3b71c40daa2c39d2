// The layout of workgroups over the list of visible tiles: in rows, since a dispatch has at most 65535 along each axis.

const TILE_ROW: u32 = 32768u;  // tiles
