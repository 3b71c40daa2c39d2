// One invocation brings light of a grid of every other pixel to four pixels, guided by depths and normals (joint
// bilateral upsampling, Kopf et al. 2007).
//
// Of the four grid pixels around it those count, by their bilinear weights, that lie on the pixel's tangent plane and
// face its way. In: light and packed normals of the grid, G-buffer. Out: the same light for each pixel, or with
// REFLECTED the radiance rho E / pi, W/(m2 sr). Errs where none of the four shows the pixel's surface: it takes the
// nearest then.
#import "gbuffer/load.wgsl"
#import "denoise/plane.wgsl"

override REFLECTED: bool = false;

@group(1) @binding(11) var<storage, read> coarse: array<vec4f>;
@group(1) @binding(12) var<storage, read> normals: array<u32>;
@group(1) @binding(13) var<storage, read_write> fine: array<vec4f>;

// A neighbour counts nothing if it lies off the tangent plane by so many widths of a pixel. Chosen.
const OFF_PLANE: f32 = 2.0;
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
    let size = (view.size + 1u) / 2u;
    let at = min(grid, size - 1u);
    let index = at.y * size.x + at.x;
    return Tap(vec2f(at * 2u), coarse[index], unpack_view_normal(normals[index]));
}

// Returns the light of a tap and its weight.
fn weigh(tap: Tap, plane: Plane, pixel: vec2f, normal: vec3f, share: f32) -> vec4f {
    let off_plane = (plane.at + dot(plane.across, tap.pixel - pixel) - plane.factor * tap.light.w) / OFF_PLANE;
    let same = max(1.0 - off_plane * off_plane, 0.0) * max(dot(normal, tap.normal), 0.0) + LEAST_WEIGHT;
    return vec4f(tap.light.rgb, 1.0) * select(0.0, (share + LEAST_WEIGHT) * same, tap.light.w > 0.0);
}

// Brings light to a pixel, `f` between the first tap and the last.
fn bring(taps: Taps, pixel: vec2u, f: vec2f) {
    if (any(pixel >= view.size)) {
        return;
    }
    let index = pixel.y * view.size.x + pixel.x;
    let seen = load_distance(pixel);
    let surface = load_surface(pixel);
    if (seen <= 0.0 || (surface.flags & GBUFFER_UNLIT) != 0u) {
        fine[index] = vec4f(0.0);
        return;
    }
    let normal = to_view(surface.normal);
    let plane = tangent_plane(pixel, plane_depth(pixel_ray(pixel), seen), normal);
    let place = vec2f(pixel);
    let g = 1.0 - f;
    let sum = weigh(taps.a, plane, place, normal, g.x * g.y) + weigh(taps.b, plane, place, normal, f.x * g.y)
        + weigh(taps.c, plane, place, normal, g.x * f.y) + weigh(taps.d, plane, place, normal, f.x * f.y);
    let light = sum.rgb / max(sum.w, 1e-30);
    let factor = select(vec3f(1.0), gbuffer_brdf(surface).diffuse * INV_PI, REFLECTED);
    fine[index] = vec4f(light * factor, 1.0);
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let pixel = id.xy * 2u;
    if (any(pixel >= view.size)) {
        return;
    }
    let taps = Taps(
        load_tap(id.xy), load_tap(id.xy + vec2u(1u, 0u)), load_tap(id.xy + vec2u(0u, 1u)), load_tap(id.xy + 1u));
    bring(taps, pixel, vec2f(0.0));
    bring(taps, pixel + vec2u(1u, 0u), vec2f(0.5, 0.0));
    bring(taps, pixel + vec2u(0u, 1u), vec2f(0.0, 0.5));
    bring(taps, pixel + 1u, vec2f(0.5));
}
