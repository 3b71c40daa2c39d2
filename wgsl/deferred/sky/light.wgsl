// One invocation computes the environment's light that a pixel's surface reflects to the eye, occluded.
//
// L = L_base V_base + L_coat V_coat, V the unoccluded shares of `occlusion.wgsl`; with COAT_LIGHT, L_base V_base +
// tint L. In: G-buffer, shares or light, prefiltered environment. Out: radiance, W/(m2 sr), cleared before. Errs by the few
// rays, and without COAT_LIGHT by the prefiltered lobes.
#import "shared/gbuffer/load.wgsl"
#import "shared/gbuffer/tiles.wgsl"
#import "deferred/environment/ambient.wgsl"
#import "common/coat.wgsl"

override COAT_LIGHT: bool = false;  // `coat_share` has the coat's light over its tint

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
    let brdf = gbuffer_brdf(surface);
    let to_eye = -pixel_ray(pixel).direction;
    let parts = ambient_parts(brdf, surface.normal, to_eye);
    var sum = parts.base * base_share[index].rgb;
    if (HAS_COATS) {
        var coat = parts.coat;
        if (COAT_LIGHT) {
            coat = coat_tint(brdf, surface.normal, to_eye);
        }
        sum += coat * coat_share[index].rgb;
    }
    light[index] = vec4f(sum, 1.0);
}
