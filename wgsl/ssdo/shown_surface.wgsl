// The surface that a pixel of the main camera's first layer shows, whether it is the surface at a point, and whether it
// sends alike in all directions.
#import "shared/gbuffer/read.wgsl"
#import "common/matte.wgsl"

// Distance of a point from the plane of the surface that a pixel shows, in widths of the pixel, up to which the surface
// is that of the point. 24 frames, one bounce: values from 0.25 to 2 differ by 1 % in relMSE in Sponza and by none in the
// Cornell box; in the courtyard 2 adds 0.3 points of bias.
const SAME_PLANE: f32 = 0.5;

struct ShownSurface {
    position: vec3f,
    normal: vec3f,   // geometric, on the camera's side
    width: f32,      // of the pixel at the surface, metres; 0: the pixel shows no surface
    is_matte: bool,  // what it sends to the camera, it sends in other directions, too
}

fn shown_surface(pixel: vec2u) -> ShownSurface {
    let seen = load_distance(pixel);
    let ray = pixel_ray(pixel);
    let surface = load_surface(pixel);
    let normal = surface.geometric_normal;
    let depth = select(seen * dot(ray.direction, view.forward), 1.0, view.orthographic != 0u);
    return ShownSurface(
        ray.origin + ray.direction * seen, select(normal, -normal, dot(normal, ray.direction) > 0.0),
        select(0.0, 2.0 * length(view.up) / f32(view.size.y) * depth, seen > 0.0),
        is_matte_brdf(gbuffer_brdf(surface)));
}

// Returns whether a point of that pixel lies on the surface that the pixel shows.
fn is_on_surface(shown: ShownSurface, point: vec3f) -> bool {
    return shown.width > 0.0 && abs(dot(shown.normal, point - shown.position)) <= SAME_PLANE * shown.width;
}

// Returns the pixel that a point projects to, or `view.size` outside the picture.
fn pixel_of_point(point: vec3f) -> vec2u {
    let clip = view.clip_from_world * vec4f(point, 1.0);
    let place = (clip.xy / clip.w * vec2f(0.5, -0.5) + 0.5) * vec2f(view.size);
    let is_inside = clip.w > 0.0 && all(place >= vec2f(0.0)) && all(place < vec2f(view.size));
    return select(view.size, vec2u(select(vec2f(0.0), place, is_inside)), is_inside);
}
