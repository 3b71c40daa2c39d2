// The radiance of a point of an emitting triangle.
#import "scene/surface.wgsl"
#import "scene/see_through.wgsl"

// Returns `radiance` times the emission texture, on the side that shines, W/(m2 sr), times the share of the point that
// is surface.
fn emission_at(triangle: u32, radiance: vec3f, weights: vec2f) -> vec3f {
    var covered = radiance;
    if (HAS_MASKS) {
        let coverage = coverage_at(load_triangle(triangle), weights);
        if (coverage <= 0.0) {
            return vec3f(0.0);
        }
        covered *= coverage;
    }
    if (HAS_TEXTURES) {
        let t = load_triangle(triangle);
        if (has_texture(t.material, EMISSION_SLOT)) {
            let k = load_corners(t, weights);
            return covered * sample_texture(t.material, EMISSION_SLOT, texcoord0_at(k), texcoord1_at(k)).rgb;
        }
    }
    return covered;
}

// Returns barycentric weights of the second and third corner, uniform over a triangle's area. Rows of constant u.y are
// parallel to the side between the first and the second corner.
fn emitter_weights(u: vec2f) -> vec2f {
    let left = sqrt(1.0 - u.y);
    return vec2f(u.x * left, 1.0 - left);
}

// Returns weights of the second and third corner of a triangle from those of its corners from number `turn` on.
fn turn_weights(weights: vec2f, turn: u32) -> vec2f {
    let turned = vec3f(1.0 - weights.x - weights.y, weights);
    return vec2f(turned[(4u - turn) % 3u], turned[(5u - turn) % 3u]);
}
