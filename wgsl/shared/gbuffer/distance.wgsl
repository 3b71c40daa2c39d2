// The distance of the surface that each pixel shows.

@group(1) @binding(31) var distance: texture_2d<f32>;  // metres along the pixel's ray, 0: nothing there

fn load_distance(pixel: vec2u) -> f32 {
    return textureLoad(distance, pixel, 0).r;
}
