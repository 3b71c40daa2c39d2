// The level-0 surfel of a pixel of the picture.
#import "shared/gbuffer/load.wgsl"
#import "ssil/surfel.wgsl"

// Least cosine between a surface and the view ray: bounds the surface area within a pixel, and so its light.
const LEAST_COSINE: f32 = 0.001;

// Returns the surfel of a pixel with a surface: eq. 2, z^2 cos(alpha) / cos(beta) times the area of a pixel that faces
// the camera at unit depth.
fn pixel_surfel(pixel: vec2u, surface: GbufferSurface, hit_distance: f32, facing: vec4f) -> Surfel {
    let ray = pixel_ray(pixel);
    let position = ray.origin - view.position + ray.direction * hit_distance;
    let cos_alpha = dot(ray.direction, view.forward);
    let cos_beta = max(abs(dot(surface.geometric_normal, ray.direction)), LEAST_COSINE);
    return Surfel(position, surface.normal, facing_area(position, facing) * cos_alpha / cos_beta);
}
