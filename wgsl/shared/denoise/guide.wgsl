// What the blur and the a-trous filter share: the tests of neighbours, and the guide, the mean luminance of each pixel
// and the variance of that mean. The guide comes from the frames of a still picture, in its first frames from
// neighbours.
#import "shared/denoise/plane.wgsl"
#import "shared/upsample/grid_pixel.wgsl"
#import "common/math.wgsl"

// A neighbour has weight 0 if its distance from the tangent plane exceeds this share of the filter's reach, in pixel
// widths: surfaces that bend by 7 degrees stay together. Smaller values leave more noise in a single frame of Sponza,
// larger ones leak at edges. tools/README.md, "Constants".
const OFF_PLANE: f32 = 0.125;
// A neighbour has weight 0 if the cosine of the normals is below 1 - 1 / PER_NORMAL = 0.9, 26 degrees; with Linke's 0.8,
// light leaks around corners.
const PER_NORMAL: f32 = 10.0;

// The first frame of a still picture whose guide comes from the frames so far. tools/README.md, "Constants".
const GUIDED_FROM: u32 = 2u;

// The variance of a blurred pixel is that of the pixels in its tent over this number. A tent of half-width 4 has 34
// independent pixels, but few values of a wide distribution mostly underestimate its variance.
const INDEPENDENT_PIXELS: f32 = 9.0;

// Returns the factor that scales distances from the tangent plane, in pixel widths, to 1 where weights reach 0.
// `reach`: of the filter, pixels.
fn plane_scale(reach: u32) -> f32 {
    return 1.0 / (OFF_PLANE * f32(reach));
}
