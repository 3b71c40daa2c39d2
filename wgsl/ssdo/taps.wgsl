// Light of a grid of pixels, one in COARSE in each row and column, for a pixel between them, guided by depths and
// normals (joint bilateral upsampling, Kopf et al. 2007).
//
// Of the four grid pixels around it those count, by their bilinear weights, that lie on the pixel's tangent plane and
// face its way. Errs where none of the four shows the pixel's surface: it takes the nearest then.
#import "scene/info.wgsl"
#import "shared/denoise/plane.wgsl"

override COARSE: u32 = 2u;  // even

@group(1) @binding(17) var<storage, read> coarse: array<vec4f>;   // in w the depth of `shared/denoise/plane.wgsl`
@group(1) @binding(18) var<storage, read> coarse_normals: array<u32>;

// A neighbour counts nothing if it lies off the tangent plane by so many widths of a pixel, each. Chosen.
const OFF_PLANE: f32 = 1.0;
// Another surface counts so much that the sum never vanishes.
const LEAST_WEIGHT: f32 = 1e-4;

struct Tap {
    pixel: vec2f,
    light: vec4f,   // and depth
    normal: vec3f,
}

struct Taps {
    a: Tap,
    b: Tap,
    c: Tap,
    d: Tap,
}

fn load_tap(grid: vec2u) -> Tap {
    let size = (view.size + COARSE - 1u) / COARSE;
    let at = min(grid, size - 1u);
    let index = at.y * size.x + at.x;
    return Tap(vec2f(at * COARSE), coarse[index], unpack_view_normal(coarse_normals[index]));
}

// Returns the pixels of the grid around those from `grid` on to the next.
fn load_taps(grid: vec2u) -> Taps {
    return Taps(
        load_tap(grid), load_tap(grid + vec2u(1u, 0u)), load_tap(grid + vec2u(0u, 1u)), load_tap(grid + 1u));
}

// Returns the weight of a tap.
fn weigh(tap: Tap, plane: Plane, pixel: vec2f, normal: vec3f, share: f32) -> f32 {
    let off_plane = (plane.at + dot(plane.across, tap.pixel - pixel) - plane.factor * tap.light.w)
        / (OFF_PLANE * f32(COARSE));
    let same = max(1.0 - off_plane * off_plane, 0.0) * max(dot(normal, tap.normal), 0.0) + LEAST_WEIGHT;
    return select(0.0, (share + LEAST_WEIGHT) * same, tap.light.w > 0.0);
}

// Returns the weights for a surface with a unit normal in the camera's frame at a depth, `f` between the first tap and
// the last.
fn weights_of(taps: Taps, pixel: vec2u, depth: f32, normal: vec3f, f: vec2f) -> vec4f {
    let plane = tangent_plane(pixel, depth, normal);
    let place = vec2f(pixel);
    let g = 1.0 - f;
    return vec4f(
        weigh(taps.a, plane, place, normal, g.x * g.y), weigh(taps.b, plane, place, normal, f.x * g.y),
        weigh(taps.c, plane, place, normal, g.x * f.y), weigh(taps.d, plane, place, normal, f.x * f.y));
}
