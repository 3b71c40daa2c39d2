// One invocation averages albedo and normal at the first hits of one pixel, for the denoiser of finished pictures.
//
// mean(x) = 1/n sum_i x(hit_i) over the n = SIDE^2 centres of equal squares of the pixel: the box filter of the path
// tracer's jittered rays, without noise. Rays pass see-through surfaces as often as light does, and are tinted.
// Out: albedo (base colour, tinted) and shading normal facing the viewer, shorter than 1 where it varies; both 0 where
// nothing is seen. Rows from the top. Errs at edges finer than 1/SIDE of a pixel.
#import "scene/surface.wgsl"
#import "scene/trace.wgsl"

// Points along a side of the pixel; 1: its centre alone, for pictures without jitter.
override SIDE: u32 = 4u;

@group(1) @binding(11) var<storage, read_write> albedo: array<vec4f>;
@group(1) @binding(12) var<storage, read_write> normal: array<vec4f>;

// Of the choices at see-through surfaces, the same in all pixels: the pattern of 1/n is no noise to the denoiser.
const PASSING: u32 = 1u;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let pixel = id.xy;
    if (any(pixel >= view.size)) {
        return;
    }
    var sum_albedo = vec3f(0.0);
    var sum_normal = vec3f(0.0);
    for (var point = 0u; point < SIDE * SIDE; point += 1u) {
        // Find the surface that the ray through the point sees.
        let place = (vec2f(vec2u(point % SIDE, point / SIDE)) + 0.5) / f32(SIDE);
        var rays: Rays;
        rays.main = camera_ray(vec2f(whole_pixel(pixel)) + place);
        rays.limit = FLOAT_MAX;
        rays.seed = PASSING;
        rays.index = point;
        let hit = traverse(rays, false, true).hit;
        if (hit.triangle == NONE) {
            continue;
        }

        // Add what the denoiser reads of it.
        let surface = surface_at(hit, rays.main.direction);
        sum_albedo += hit.tint * surface.base_color;
        sum_normal += surface.normal;
    }
    let share = 1.0 / f32(SIDE * SIDE);
    let index = pixel.y * view.size.x + pixel.x;
    albedo[index] = vec4f(sum_albedo * share, 1.0);
    normal[index] = vec4f(sum_normal * share, 0.0);
}
