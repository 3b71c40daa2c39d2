// Joint bilateral upsampling (Kopf et al. 2007): the weights of the four coarse pixels around a fine pixel.
//
// w_k = (b_k + WEIGHT_FLOOR) (s_k + WEIGHT_FLOOR), b_k the bilinear weight, s_k in 0 to 1 the similarity of both
// surfaces: s_k = max(1 - d_k^2, 0) max(n . n_k, 0)^4, d_k the larger of both distances of one surface from the tangent
// plane of the other, in widths of a coarse pixel. Errs where no coarse pixel shows the surface: the most similar pixels
// count.
#import "scene/info.wgsl"

override COARSE_STRIDE: u32 = 2u;       // fine pixels along the side of a coarse one
override COARSE_CENTRED: bool = false;  // true: a coarse pixel samples its square's centre; false: its first pixel

// Keeps the sum above 0 wherever a coarse pixel shows something; leaks at most 0.2 % of another surface's light into
// pixels that a coarse pixel represents.
const WEIGHT_FLOOR: f32 = 1e-4;

// The exponent 4 of n . n_k: SSIL by rays, 160x90, 16 frames, relMSE of exponents 1 and 4: Sponza (a) 4.33, 4.29, its
// gallery 13.6, 10.5, a curtained room .048, .017; Cornell the same. 16 lists twice the pixels for 0.1 less in Sponza.
// With the distance from the fine surface's plane alone, Sponza (a), 320x180, has 1.17 instead of 0.83: round columns
// and the undersides of arches take the light of other parts.
struct GuideSurface {
    position: vec3f,  // metres from the camera, along the axes of the world or of the camera
    normal: vec3f,    // unit
    exists: bool,
}

// Returns the number of fine pixels per metre on a surface that faces the camera.
fn pixels_per_metre(position: vec3f) -> f32 {
    let depth = select(dot(position, view.forward), 1.0, view.orthographic != 0u);
    return f32(view.whole.x) / max(2.0 * length(view.right) * depth, 1e-37);
}

// Returns the similarity of two surfaces, 0 to 1; `per_metre`: coarse pixels per metre at `fine`.
fn similarity(fine: GuideSurface, other: GuideSurface, per_metre: f32) -> f32 {
    let way = other.position - fine.position;
    let off_plane = max(abs(dot(fine.normal, way)), abs(dot(other.normal, way))) * per_metre;
    let aligned = max(dot(fine.normal, other.normal), 0.0);
    let squared = aligned * aligned;
    let similar = max(1.0 - off_plane * off_plane, 0.0) * squared * squared;
    return select(0.0, similar, other.exists);
}

// The four coarse pixels around a fine one, those of the first row first.
struct CoarseTaps {
    first: vec2i,
    bilinear: vec4f,
}

fn coarse_taps(pixel: vec2u) -> CoarseTaps {
    let origin = select(0.0, 0.5 * f32(COARSE_STRIDE - 1u), COARSE_CENTRED);
    let place = (vec2f(pixel) - origin) / f32(COARSE_STRIDE);
    let f = fract(place);
    let g = 1.0 - f;
    return CoarseTaps(vec2i(floor(place)), vec4f(g.x * g.y, f.x * g.y, g.x * f.y, f.x * f.y));
}

// Returns the coarse pixel of a tap, 0 to 3; beyond the border of the picture, the nearest one.
fn tap_pixel(taps: CoarseTaps, k: u32, coarse_size: vec2u) -> vec2u {
    return vec2u(clamp(taps.first + vec2i(vec2u(k & 1u, k >> 1u)), vec2i(0), vec2i(coarse_size) - 1));
}

// Returns w_k, not normalised, of a bilinear weight and a similarity; 0 where the coarse pixel shows nothing.
fn bilateral_weight(bilinear: f32, similar: f32, exists: bool) -> f32 {
    return select(0.0, (bilinear + WEIGHT_FLOOR) * (similar + WEIGHT_FLOOR), exists);
}
