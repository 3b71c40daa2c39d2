// One invocation brings light of a coarser grid to a pixel, guided by depths and normals (joint bilateral upsampling,
// Kopf et al. 2007).
//
// Of the four grid pixels around it those count, by their bilinear weights, that lie on the pixel's tangent plane and
// face its way. In: light and packed normals of the grid, G-buffer. Out: the same light for each pixel, or with
// REFLECTED the radiance rho E / pi, W/(m2 sr). Errs where none of the four shows the pixel's surface: it takes the
// nearest then.
#import "gbuffer/load.wgsl"
#import "denoise/plane.wgsl"

override STRIDE: u32 = 2u;
override REFLECTED: bool = false;

@group(1) @binding(11) var<storage, read> coarse: array<vec4f>;
@group(1) @binding(12) var<storage, read> normals: array<u32>;
@group(1) @binding(13) var<storage, read_write> fine: array<vec4f>;

// A neighbour counts nothing if it lies off the tangent plane by so many widths of a pixel. Chosen.
const OFF_PLANE: f32 = 2.0;
// Another surface counts so much that the sum never vanishes.
const LEAST_WEIGHT: f32 = 1e-4;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let pixel = id.xy;
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
    let depth = plane_depth(pixel_ray(pixel), seen);
    let normal = unpack_view_normal(pack_view_normal(surface.normal));
    let plane = tangent_plane(pixel, depth, normal);
    let last = (view.size + STRIDE - 1u) / STRIDE - 1u;
    let first = pixel / STRIDE;
    let f = vec2f(pixel % STRIDE) / f32(STRIDE);
    var sum = vec4f(0.0);
    for (var k = 0u; k < 4u; k += 1u) {
        let offset = vec2u(k & 1u, k >> 1u);
        let grid = min(first + offset, last);
        let at = grid.y * (last.x + 1u) + grid.x;
        let tap = coarse[at];
        let away = vec2f(grid * STRIDE) - vec2f(pixel);
        let off_plane = (plane.at + dot(plane.across, away) - plane.factor * tap.w) / OFF_PLANE;
        let facing = dot(normal, unpack_view_normal(normals[at]));
        let same = max(1.0 - off_plane * off_plane, 0.0) * max(facing, 0.0) + LEAST_WEIGHT;
        let share = select(1.0 - f, f, offset == vec2u(1u));
        sum += vec4f(tap.rgb, 1.0) * select(0.0, (share.x * share.y + LEAST_WEIGHT) * same, tap.w > 0.0);
    }
    let light = sum.rgb / max(sum.w, 1e-30);
    let factor = select(vec3f(1.0), gbuffer_brdf(surface).diffuse * INV_PI, REFLECTED);
    fine[index] = vec4f(light * factor, 1.0);
}
