// The tiles of 8x8 pixels that show a surface: passes over them skip the sky.
#import "shared/gbuffer/tile_row.wgsl"

@group(1) @binding(34) var<storage, read> seen_tiles: array<u32>;
// Workgroups along x (at most TILE_ROW), y and z; number of tiles.
@group(1) @binding(35) var<storage, read> tile_groups: array<u32>;

// Returns a thread's pixel, or `size` (outside the picture) for threads beyond the list.
fn pixel_of_tile(group: vec3u, thread: vec3u, size: vec2u) -> vec2u {
    let number = group.y * TILE_ROW + group.x;
    if (number >= tile_groups[3]) {
        return size;
    }
    let columns = (size.x + 7u) / 8u;
    let tile = seen_tiles[number];
    return vec2u(tile % columns, tile / columns) * 8u + thread.xy;
}
