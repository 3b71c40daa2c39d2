// The ray by which a pixel looks for light that no pixel shows, and what it hits.
#import "shared/gbuffer/in_picture.wgsl"
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

// Returns what a ray from a surfel at `position`, metres, hits; `direction`: unit.
fn offscreen_hit(position: vec3f, direction: vec3f) -> OffscreenHit {
    // Surfels have no geometric normal, so the origin moves along the ray, as that of `gather_exact.wgsl`.
    let offset = 20.0 * ray_offset(ANY_NORMAL, pixel_terms(position));
    var found: OffscreenHit;
    found.direction = direction;
    found.hit = trace(Ray(position + direction * offset, direction), FLOAT_MAX);
    if (found.hit.triangle == NONE) {
        return found;
    }
    found.surface = surface_at(found.hit, direction);
    let normal = found.surface.geometric_normal;
    found.side = select(-normal, normal, found.surface.front);
    found.reflectance = reflectance_of(found.surface);
    let black = (found.surface.flags & UNLIT) != 0u || max3(found.reflectance) <= 0.0;
    if (black || is_in_picture(found.surface.position, found.side)) {
        found.hit.triangle = NONE;
    }
    return found;
}
