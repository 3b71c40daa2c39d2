// A pixel of the picture as a surfel of the finest level.
#import "shared/gbuffer/load.wgsl"
#import "ssil/surfel.wgsl"

// Surfaces count as turned by at most this cosine away from the camera: their pixels' areas would grow without bound.
const LEAST_COSINE: f32 = 0.001;

// Returns the surfel of a pixel that shows something: eq. 2, z^2 cos(alpha) / cos(beta) times the facing pixel's area.
fn pixel_surfel(pixel: vec2u, surface: GbufferSurface, seen: f32, facing: vec4f) -> Surfel {
    let ray = pixel_ray(pixel);
    let position = ray.origin - view.position + ray.direction * seen;
    let along = dot(ray.direction, view.forward);
    let slope = max(abs(dot(surface.geometric_normal, ray.direction)), LEAST_COSINE);
    return Surfel(position, surface.normal, facing_area(position, facing) * along / slope);
}
