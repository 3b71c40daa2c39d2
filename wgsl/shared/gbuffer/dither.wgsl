// The number by which a pixel of the whole picture shows a see-through triangle or what lies behind it.
//
// Over the picture, an ordered dither (Bayer 1973) with Owen scrambling, so that squares of 2^k pixels spread evenly over
// [0, 1); over frames, a shuffled van der Corput sequence that rotates it. Both differ by triangle, so that stacked surfaces
// are independent, and by seed.
#import "common/random.wgsl"
#import "scene/info.wgsl"
#import "scene/sequence.wgsl"

fn dither(pixel: vec2u, triangle: u32) -> f32 {
    // Interleave the bits of x ^ y and y: pixels next to each other differ in the first digit, as on a chessboard.
    let folded = vec2u(pixel.x ^ pixel.y, pixel.y) & vec2u(31u);
    var bits = folded.x | (folded.y << 16u);
    bits = (bits | (bits << 4u)) & 0x0f0f0f0fu;
    bits = (bits | (bits << 2u)) & 0x33333333u;
    bits = (bits | (bits << 1u)) & 0x55555555u;
    let place = (bits & 0xffffu) | (bits >> 15u);
    let seed = hash2(triangle, scene.seed);
    let block = hash2(pixel.x / 32u, hash2(pixel.y / 32u, seed));
    let across = sobol_2d(place, block).x;
    let over_frames = sobol_2d(sequence.index, hash(seed)).x;
    return fract(across + over_frames);
}
