// Warps from the unit square to directions and triangles.
#import "common/math.wgsl"

// Returns a direction about +Z with density cos / pi.
fn sample_cosine_hemisphere(u: vec2f) -> vec3f {
    let r = sqrt(u.x);
    let phi = TWO_PI * u.y;
    return vec3f(r * cos(phi), r * sin(phi), sqrt(max(1.0 - u.x, 0.0)));
}

// Returns barycentric weights of the second and third vertex, uniform over a triangle's area, with less distortion than
// the square root map (Heitz 2019, "A Low-Distortion Map Between Triangle and Square").
fn sample_triangle(u: vec2f) -> vec2f {
    if (u.y > u.x) {
        let half_x = 0.5 * u.x;
        return vec2f(half_x, u.y - half_x);
    }
    let half_y = 0.5 * u.y;
    return vec2f(u.x - half_y, half_y);
}
