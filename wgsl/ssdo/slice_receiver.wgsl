// The pixel that slices of the hemisphere start from, and the random numbers of its slices.
#import "scene/sequence.wgsl"
#import "shared/gbuffer/load.wgsl"
#import "common/random.wgsl"
#import "ssdo/search_radius.wgsl"

override SLICES: u32 = 1u;      // per pixel
override INTERLEAVE: u32 = 4u;  // side of the squares of pixels that share a stratified set of slices

// Additive recurrences that spread evenly: the golden ratio, and for three dimensions (Roberts 2018, "The Unreasonable
// Effectiveness of Quasirandom Sequences").
const GOLDEN: f32 = 0.6180339887;
const SPREAD: vec3f = vec3f(0.8191725134, 0.6710436067, 0.5497004779);

// A pixel that slices start from.
struct Receiver {
    is_lit: bool,
    position: vec3f,
    normal: vec3f,
    side: vec3f,     // geometric normal, towards the eye
    ray: Ray,        // unit, from the eye
    seen: f32,       // distance along it, metres
    place: vec2f,    // pixels
    radius: f32,     // r_max, metres
}

// `heights`: largest r_max, in heights of the picture at the receiver.
fn load_receiver(pixel: vec2u, heights: f32) -> Receiver {
    let seen = load_distance(pixel);
    let surface = load_surface(pixel);
    let ray = pixel_ray(pixel);
    let faces = dot(surface.geometric_normal, ray.direction) < 0.0;
    return Receiver(
        seen > 0.0 && (surface.flags & GBUFFER_UNLIT) == 0u, ray.origin + ray.direction * seen, surface.normal,
        select(-surface.geometric_normal, surface.geometric_normal, faces), ray, seen, vec2f(pixel) + view.offset,
        search_radius(ray, seen, heights));
}

// Random numbers of a slice, 0 to 1: of its azimuth, of its taps' places, of its sectors' borders, and one more.
struct SliceNumbers {
    azimuth: f32,
    place: f32,
    border: f32,
    further: f32,
}

// Returns the numbers of slice `number` of a pixel of the grid. The n^2 pixels of a square share strata, and so do all
// pixels of any other n x n square of the grid.
fn slice_numbers(grid: vec2u, number: u32, seed: u32) -> SliceNumbers {
    // Strata interleave: neighbours differ much (Bayer 1973, for n = 4).
    let count = INTERLEAVE * INTERLEAVE;
    let bits = vec2u((grid.x ^ grid.y) % INTERLEAVE, grid.y % INTERLEAVE);
    let stratum = ((bits.x & 1u) << 3u) | ((bits.y & 1u) << 2u) | (bits.x & 2u) | (bits.y >> 1u);
    let strata = vec4f(vec4u(1u, 5u, 3u, 7u) * stratum % vec4u(count));
    let pixel = hash(grid.x + hash(grid.y + hash(seed)));
    let within = vec4f(
        unit_float(pixel), unit_float(hash(pixel + 1u)), unit_float(hash(pixel + 2u)), unit_float(hash(pixel + 3u)));
    let frame = f32(sequence.index * SLICES + number) * vec4f(GOLDEN, SPREAD);
    let at = fract((strata + within) / f32(count) + fract(frame));
    return SliceNumbers(at.x, at.y, at.z, at.w);
}
