// The light that a path's ray meets: an emitter, or the environment.
#import "scene/lights.wgsl"

struct Arriving {
    radiance: vec3f,    // W/(m2 sr)
    light_pdf: f32,     // of its point by N, 1/sr at the ray's origin
    ray_density: f32,   // of a light ray at the ray's origin, 1/m2 on a surface that faces it
}

// Returns the light that a ray meets. `s`: the surface hit, if `hit`; `squared_distance`: of the hit, m2; `cosine`: between
// the ray and the surface's geometric normal; `is_camera_ray`: unlit surfaces show, and the background may be hidden.
fn arriving_at(
    s: Surface, hit: bool, direction: vec3f, squared_distance: f32, cosine: f32, is_camera_ray: bool
) -> Arriving {
    if (!hit) {
        let radiance = environment_radiance(direction) * select(1.0, view.background, is_camera_ray);
        return Arriving(radiance, environment_pdf(direction), parallel_density());
    }
    var radiance = s.emission;
    if ((s.flags & UNLIT) != 0u) {
        radiance = select(vec3f(0.0), s.base_color, is_camera_ray);
    }
    return Arriving(
        radiance, s.emitter_pdf * squared_distance / cosine,
        cosine * INV_PI * side_share((s.flags & DOUBLE_SIDED) != 0u) / squared_distance);
}
