// What photons leave at the pixels: fixed-point flux, so that sums do not depend on the order of atomic additions. The
// importing shader declares `params` with `count`, the number of photons.
#import "shared/gbuffer/read.wgsl"

@group(1) @binding(13) var<storage, read> totals: array<f32>;  // cumulative weights of the candidates' blocks, W

// Units of the flux of a photon of the least weight. A sum holds 65,536 of them, millions of usual ones.
const UNITS: f32 = 65536.0;

// Returns one unit, W. `least`: PHOTON_FLOOR of `many_light/vpl/weights.wgsl`.
fn deposit_unit() -> f32 {
    return totals[arrayLength(&totals) - 1u] / (f32(params.count) * params.least_weight * UNITS);
}

// Returns the squared width of a pixel's footprint, m2.
fn squared_width(pixel: vec2u) -> f32 {
    let along = load_distance(pixel) * dot(pixel_ray(pixel).direction, view.forward);
    let width = 2.0 * length(view.up) * select(along, 1.0, view.orthographic != 0u) / f32(view.whole.y);
    return width * width;
}
