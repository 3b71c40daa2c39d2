// One invocation estimates the light of all emitters at a pixel, with few shadow rays (`deferred/emitters/estimate.wgsl`).
//
// L = int f_r L_e cos V. In: G-buffer, emitters, scene. Out: light, L over `emitter_tint`, and the depth of
// `shared/denoise/plane.wgsl`, 0 where there is nothing to light; normals; the variance of its luminance,
// in squares of `scene.light_unit`. Unbiased but for the rays' offset and their
// end short of the emitter (bright: blockers in the last 0.01 % are missed); noisy in penumbrae.
#import "deferred/emitters/estimate.wgsl"
#import "deferred/emitters/tint.wgsl"
#import "shared/gbuffer/read.wgsl"
#import "shared/gbuffer/visible_surface.wgsl"
#import "shared/gbuffer/tiles.wgsl"
#import "shared/denoise/plane.wgsl"
#import "scene/sequence.wgsl"

@group(1) @binding(11) var<storage, read_write> light: array<vec4f>;
@group(1) @binding(12) var<storage, read_write> normals: array<u32>;
@group(1) @binding(13) var<storage, read_write> variances: array<f32>;
@group(1) @binding(19) var<uniform> params: Params;

struct Params {
    seed: u32,
}

@compute @workgroup_size(8, 8)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) thread: vec3u) {
    let pixel = pixel_of_tile(group, thread, view.size);
    if (any(pixel >= view.size)) {
        return;
    }
    let surface = load_surface(pixel);
    let distance_seen = load_distance(pixel);
    if (distance_seen <= 0.0 || (surface.flags & GBUFFER_UNLIT) != 0u) {
        return;
    }
    let ray = pixel_ray(pixel);
    // Rays start from the triangle itself: a pixel on a silhouette may see a point beside it, and the point is in the
    // triangle's plane whatever the distance to the camera, so that the offset need not grow with it.
    let seen = load_visibility(pixel);
    let triangle = load_triangle(seen.x);
    let point = point_of_hit(triangle, hit_on_triangle(ray, triangle, seen.x, seen.y));
    let r = receiver(point.position, surface.normal, surface.geometric_normal, gbuffer_brdf(surface), -ray.direction);
    let offset = ray_offset(surface.geometric_normal, SLIVERS * point.terms);
    let found = scattered_from_emitters(r, offset, whole_pixel(pixel), sequence.index, params.seed);
    let index = pixel.y * view.size.x + pixel.x;
    let tint = emitter_tint(r.brdf, r.normal, -ray.direction);
    let sum = sum_of(found) / tint;
    light[index] = vec4f(select(vec3f(0.0), sum, is_finite(sum)), plane_depth(ray, distance_seen));
    // Half the difference of two estimates is the standard error of their mean; one sample tells nothing of its own.
    let apart = 0.5 * luminance((found.halves[0] - found.halves[1]) / tint) / scene.light_unit;
    let alone = 0.5 * luminance(found.by_brdf / tint) / scene.light_unit;
    variances[index] = min(apart * apart + alone * alone, 1e30);
    normals[index] = pack_view_normal(surface.normal);
}
