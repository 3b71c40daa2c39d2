// The side of the tiles of tiled shading: each has a list of lights.

const TILE: u32 = 16u;  // pixels a side
