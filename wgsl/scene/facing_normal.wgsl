// The shading normal as a viewer sees it: on the viewer's side of the surface, and not turned away from the viewer.
//
// Vertex normals and normal maps may face away from a viewer who sees the surface: there, BRDFs are 0, and the pixel is
// black. A normal map's normal n also may mirror the view direction w to below the surface of geometric normal g. It is
// turned towards g by the least angle that lifts the mirrored direction r = 2 (n . w) n - w to r . g >= t,
// t = min(0.9 w . g, 0.01): Blender Cycles' `ensure_valid_specular_reflection`. In the plane of g and n, x across g, this is
// 4 n_x^2 n_z^2 w_x^2 = (t + w_z - 2 w_z n_z^2)^2. Errs bright where bumps hide each other.
#import "common/math.wgsl"

// Least cosine between the normal and the view direction: 20 times the rounding of stored normals.
const LEAST_FACING: f32 = 1e-3;

// Returns the normal of unit `n` that faces `to_eye`. `side`: geometric normal on the viewer's side. `bumped`: n is of a
// normal map. All are unit.
fn facing_normal(n: vec3f, side: vec3f, to_eye: vec3f, bumped: bool) -> vec3f {
    var turned = n;
    if (bumped) {
        let mirrored = 2.0 * dot(n, to_eye) * n - to_eye;
        let height = dot(side, to_eye);
        let threshold = min(0.9 * height, 0.01);
        if (dot(side, mirrored) < threshold || dot(n, to_eye) <= 0.0) {
            // Solve the quadratic for n_z^2; the second form of the smaller root does not cancel.
            let x = normalize_or(n - dot(n, side) * side, vec3f(0.0));
            let along = dot(to_eye, x);
            let a = along * along + height * height;
            let b = 2.0 * (a + height * threshold);
            let c = (threshold + height) * (threshold + height);
            let root = sqrt(max(b * b - 4.0 * a * c, 0.0));
            let squared = saturate(select(c / (b + root), 0.25 * (b + root) / a, along < 0.0));
            turned = normalize_or(sqrt(1.0 - squared) * x + sqrt(squared) * side, side);
        }
    }
    let facing = dot(turned, to_eye);
    if (facing < LEAST_FACING) {
        turned = normalize_or(turned + (LEAST_FACING - facing) * to_eye, to_eye);
    }
    return turned;
}
