// The ray by which a pixel looks for light that no pixel shows, and what it hits.
#import "shared/gbuffer/in_picture.wgsl"
#import "shared/gbuffer/visible_surface.wgsl"
#import "shared/radiance_cache/reflectance.wgsl"
#import "scene/trace.wgsl"
#import "common/random.wgsl"

// A surface that no pixel shows.
struct OffscreenHit {
    hit: Hit,            // its triangle is NONE if the ray brings no light that SSIL misses
    direction: vec3f,    // of the ray, unit
    surface: Surface,
    side: vec3f,         // geometric normal towards the ray's origin
    reflectance: vec3f,
}

// Returns the surface that a pixel of the picture shows; it must show one.
fn shown_surface(pixel: vec2u) -> Surface {
    let seen = load_visibility(pixel);
    let triangle = load_triangle(seen.x);
    let ray = pixel_ray(pixel);
    return surface_on(triangle, hit_on_triangle(ray, triangle, seen.x, seen.y), ray.direction);
}

// Returns what a ray from a surface hits; `direction`: unit.
fn offscreen_hit(start: Surface, direction: vec3f) -> OffscreenHit {
    var found: OffscreenHit;
    found.direction = direction;
    found.hit = trace(Ray(leave_surface(start, direction), direction), FLOAT_MAX);
    if (found.hit.triangle == NONE) {
        return found;
    }
    found.surface = surface_at(found.hit, direction);
    let normal = found.surface.geometric_normal;
    found.side = select(-normal, normal, found.surface.front);
    found.reflectance = reflectance_of(found.surface) * found.hit.tint;
    let black = (found.surface.flags & UNLIT) != 0u || max3(found.reflectance) <= 0.0;
    if (black || is_in_picture(found.surface.position, found.side)) {
        found.hit.triangle = NONE;
    }
    return found;
}
