// The radiance of a point of an emitting triangle.
#import "scene/surface.wgsl"

// Returns `radiance` times the emission texture, on the side that shines, W/(m2 sr); 0 where the triangle is cut out.
fn emission_at(triangle: u32, radiance: vec3f, weights: vec2f) -> vec3f {
    if (HAS_MASKS) {
        let t = load_triangle(triangle);
        if ((t.flags & MASKED) != 0u && is_cut_out(t, weights)) {
            return vec3f(0.0);
        }
    }
    if (HAS_TEXTURES) {
        let t = load_triangle(triangle);
        if (has_texture(t.material, EMISSION_SLOT)) {
            let k = load_corners(t, weights);
            return radiance * sample_texture(t.material, EMISSION_SLOT, texcoord0_at(k), texcoord1_at(k)).rgb;
        }
    }
    return radiance;
}
