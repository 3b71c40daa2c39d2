// One invocation computes the environment's light that a pixel's surface reflects to the eye, occluded.
//
// L = L_base V_base + L_coat V_coat, V the unoccluded shares of `occlusion.wgsl`. In: G-buffer, shares, prefiltered
// environment. Out: radiance, W/(m2 sr), cleared before. Errs by the shares' few rays and the prefiltered lobes.
#import "shared/gbuffer/load.wgsl"
#import "shared/gbuffer/tiles.wgsl"
#import "deferred/environment/ambient.wgsl"

@group(1) @binding(11) var<storage, read_write> light: array<vec4f>;
@group(1) @binding(12) var<storage, read> base_share: array<vec4f>;
@group(1) @binding(13) var<storage, read> coat_share: array<vec4f>;

@compute @workgroup_size(8, 8)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) thread: vec3u) {
    let pixel = pixel_of_tile(group, thread, view.size);
    if (any(pixel >= view.size)) {
        return;
    }
    let surface = load_surface(pixel);
    if (load_distance(pixel) <= 0.0 || (surface.flags & GBUFFER_UNLIT) != 0u) {
        return;
    }
    let index = pixel.y * view.size.x + pixel.x;
    let parts = ambient_parts(gbuffer_brdf(surface), surface.normal, -pixel_ray(pixel).direction);
    var sum = parts.base * base_share[index].rgb;
    if (HAS_COATS) {
        sum += parts.coat * coat_share[index].rgb;
    }
    light[index] = vec4f(sum, 1.0);
}
