// The order in which the path tracer visits the pixels.
#import "scene/info.wgsl"

// Returns the pixel of a thread: a workgroup is a tile of 8 x 8 pixels, so that rays of a SIMD group stay close.
// Consecutive rows of tiles lie far apart in the picture, so that all dispatches take about the same time per workgroup,
// not a few ms for the sky and seconds for a room.
fn pixel_of(workgroup: u32, local: u32, row_stride: u32) -> vec2u {
    let tiles = (view.size + 7u) / 8u;
    let row = (workgroup / tiles.x) * row_stride % tiles.y;
    return vec2u(workgroup % tiles.x, row) * 8u + vec2u(local % 8u, local / 8u);
}
