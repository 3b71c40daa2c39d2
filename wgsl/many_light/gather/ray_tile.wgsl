// Tiles of pixels with the same number of shadow rays: those of a row of a workgroup's threads in all classes, which are
// 8 n x 4 n pixels of the grid.
//
// Statistics of a thread: its lit pixels; the sum of their radiances; the sums of the variances of their radiances by
// visibility, with one ray and with the rays of this frame. Radiance in `scene.light_unit`.
#import "many_light/gather/pixels.wgsl"

const MOST_RAYS: u32 = 8u;

// Returns the tile of a thread of `place_of`.
fn tile_of_thread(group: vec3u, thread: vec3u) -> vec2u {
    return vec2u(group.x, group.y / class_count() * GROUP_Y + thread.y);
}

// Returns the first thread of a class' row of threads, as (x, y) of all threads.
fn first_thread(tile: vec2u, class_number: u32) -> vec2u {
    return vec2u(tile.x * GROUP_X, (tile.y / GROUP_Y * class_count() + class_number) * GROUP_Y + tile.y % GROUP_Y);
}
