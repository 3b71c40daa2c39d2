// What the frames of a still picture so far tell of a tile's noise; radiance in `scene.light_unit`.
#import "many_light/gather/ray_tile.wgsl"

struct RayTile {
    radiance: f32,  // mean over the tile's lit pixels and over frames
    squares: f32,   // sum over frames of the squared deviations of the tile's radiance
    one_ray: f32,   // variance of a pixel's radiance by visibility, with one ray
    rays: f32,      // variance of the tile's radiance in a frame by visibility, with the rays it had
    pixels: f32,    // lit
}
