// Random numbers of a pixel's samples of emitters: additive recurrences over the samples, with an offset for each pixel
// that differs most between neighbours (Roberts 2018, "The Unreasonable Effectiveness of Quasirandom Sequences"). So
// the samples of a pixel are even over the emitters, and so are those of a small square in one frame.
#import "common/random.wgsl"

// Multiples of 2^32 that are independent over the rationals: golden ratio, R2, square roots of 3, 7 and 11.
const STEP_CHOICE: u32 = 2654435769u;
const STEP_POINT: u32 = 3242174889u;
const STEP_LOBE: u32 = 3144134277u;
const STEP_BRDF_X: u32 = 2773480762u;
const STEP_BRDF_Y: u32 = 1359893119u;
// Offsets of pixels: R2.
const PIXEL_X: u32 = 3242174889u;
const PIXEL_Y: u32 = 2447445414u;

struct Numbers {
    choice: f32,    // of the emitter
    point: f32,     // on it
    lobe: f32,      // of the BRDF's sample, and its direction
    brdf: vec2f,
}

fn to_unit(code: u32) -> f32 {
    return f32(code >> 8u) / 16777216.0;
}

// Returns the numbers of a pixel's sample `index`, counted over all frames.
fn sample_numbers(pixel: vec2u, index: u32, seed: u32) -> Numbers {
    let key = hash(seed);
    let a = pixel.x * PIXEL_X + pixel.y * PIXEL_Y + key;
    let b = pixel.x * PIXEL_Y - pixel.y * PIXEL_X + hash(key);
    // The other numbers need no order between pixels.
    let own = hash2(pixel.x, hash2(pixel.y, key));
    return Numbers(
        to_unit(a + index * STEP_CHOICE), to_unit(b + index * STEP_POINT),
        to_unit(own + index * STEP_LOBE),
        vec2f(
            to_unit(a + 0x80000000u + index * STEP_BRDF_X), to_unit(b + 0x80000000u + index * STEP_BRDF_Y)));
}
