// A G-buffer pixel's surface for joint bilateral upsampling.
#import "shared/gbuffer/load.wgsl"
#import "shared/upsample/weights.wgsl"

// Returns a pixel's surface; it does not exist where there is nothing to light. `outward`: true turns the normal to the
// counter-clockwise side, false to the viewer.
fn gbuffer_guide_surface(pixel: vec2u, outward: bool) -> GuideSurface {
    let surface = load_surface(pixel);
    let seen = load_distance(pixel);
    let ray = pixel_ray(pixel);
    let is_back = outward && dot(surface.geometric_normal, ray.direction) >= 0.0;
    return GuideSurface(
        ray.origin - view.position + ray.direction * seen, select(surface.normal, -surface.normal, is_back),
        seen > 0.0 && (surface.flags & GBUFFER_UNLIT) == 0u);
}
