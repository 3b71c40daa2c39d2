// Whether a surface sends alike in all directions.
#import "common/brdf.wgsl"
#import "common/math.wgsl"

// A surface is matte if its coat sends at most this share of what its base sends, in the direction where it sends most.
const MOST_COAT: f32 = 0.5;

// Returns whether what a surface sends in one direction, it sends in all: F0 / (4 pi alpha^2) is the peak of its coat.
fn is_matte_brdf(brdf: Brdf) -> bool {
    if (HAS_CLEARCOAT && brdf.clearcoat.share > 0.0) {
        let width = brdf.alpha / brdf.clearcoat.alpha;
        let peak = luminance(brdf.f0) + brdf.clearcoat.share * DIELECTRIC_F0 * width * width;
        return peak <= 4.0 * MOST_COAT * brdf.alpha * brdf.alpha * luminance(brdf.diffuse);
    }
    return !brdf.glossy || luminance(brdf.f0) <= 4.0 * MOST_COAT * brdf.alpha * brdf.alpha * luminance(brdf.diffuse);
}
