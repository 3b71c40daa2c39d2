// The tiles of pixels that have a list of lights each.

const TILE: u32 = 16u;  // pixels a side
