// A pixel's surface, as a receiver of light from VPLs.
#import "shared/gbuffer/read.wgsl"
#import "shared/denoise/plane.wgsl"
#import "common/coat.wgsl"
#import "many_light/gather/near_field.wgsl"

struct Receiver {
    position: vec3f,
    normal: vec3f,            // shading, towards the viewer; 0 where the pixel shows no lit surface
    geometric_normal: vec3f,
    depth: f32,               // of `shared/denoise/plane.wgsl`; 0 where the pixel shows no lit surface
    brdf: Brdf,
    to_eye: vec3f,
    eye_loss: CoatLoss,       // of the coat, towards the eye
    near_radius: f32,         // r_max of the near field, metres
}

// The pixels of a thread.
struct Receivers {
    a: Receiver,
    b: Receiver,
    c: Receiver,
    d: Receiver,
}

// Returns the receiver of a pixel; beyond the picture, the last pixel's receiver (its results are not stored).
// `near_radius` is r_max of the near field in heights of the picture.
fn load_receiver(pixel: vec2u, near_radius: f32) -> Receiver {
    let inside = min(pixel, view.size - 1u);
    let surface = load_surface(inside);
    let seen = load_distance(inside);
    let lit = seen > 0.0 && (surface.flags & GBUFFER_UNLIT) == 0u;
    let ray = pixel_ray(inside);
    let brdf = gbuffer_brdf(surface);
    return Receiver(
        ray.origin + ray.direction * seen, select(vec3f(0.0), surface.normal, lit), surface.geometric_normal,
        select(0.0, plane_depth(ray, seen), lit), brdf, -ray.direction,
        loss_to_eye(brdf, surface.normal, -ray.direction), search_radius(ray, seen, near_radius));
}
