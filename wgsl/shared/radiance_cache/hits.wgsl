// The hits of rays whose light the radiance cache gives, 32 bytes each.
#import "scene/trace.wgsl"

struct CacheHit {
    triangle: u32,
    instance: u32,
    from_anchor: vec2f,
    direction: u32,     // of the ray: octahedral, snorm 16
    cell: u32,          // NO_CELL: the ray brings no light
    reflectance: u32,   // square roots of r, g, b in 10 bits each
    pad: u32,
}

fn no_cache_hit() -> CacheHit {
    return CacheHit(NONE, NONE, vec2f(0.0), 0u, 0xffffffffu, 0u, 0u);
}

// Returns the record of a hit by a ray of a unit direction.
fn cache_hit(hit: Hit, direction: vec3f, cell: u32, reflectance: vec3f) -> CacheHit {
    return CacheHit(
        hit.triangle, hit.instance, hit.from_anchor, pack2x16snorm(octahedral_encode(direction)), cell,
        pack_reflectance(reflectance), 0u);
}

fn pack_reflectance(color: vec3f) -> u32 {
    let code = vec3u(round(sqrt(clamp(color, vec3f(0.0), vec3f(1.0))) * 1023.0));
    return code.r | (code.g << 10u) | (code.b << 20u);
}

fn unpack_reflectance(code: u32) -> vec3f {
    let color = vec3f(vec3u(code, code >> 10u, code >> 20u) & vec3u(1023u)) / 1023.0;
    return color * color;
}
