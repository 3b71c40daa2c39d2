// One invocation integrates one entry of the table of directional albedos of a coat, for light scattered once.
//
// Along x: cos_o = (x / (W - 1))^3; along y: GGX alpha from MIN_ALPHA to 1 by its fourth root. Of the lobe D V cos_i:
//   r  R = integral D V cos_i dw, the coat's directional albedo without Fresnel's factor
//   g  the cosine c at which Fresnel's factor equals its mean: integral (1 - v.h)^5 D V cos_i dw = R (1 - c)^5
//   b  sine of the lobe's mean direction to the normal, over the sine of w_o: 1 for a mirror
// by the midpoint rule over visible normals (Dupuy and Benyoub 2023), denser towards both ends of their range, where
// the shadowing term has kinks. Errs only by the rule: 2048 points.
#import "common/ggx.wgsl"

@group(1) @binding(11) var table: texture_storage_2d<rgba32float, write>;

// Numbers of points over the normals' height and over half a turn of azimuth.
const HEIGHTS: u32 = 64u;
const TURNS: u32 = 32u;
// Exactly parallel and perpendicular views are excluded: their quotients are 0 / 0.
const SMALLEST_COSINE: f32 = 1e-5;
const LARGEST_COSINE: f32 = 0.9999;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(table);
    if (any(id.xy >= size)) {
        return;
    }
    let at = vec2f(id.xy) / vec2f(size - 1u);
    let cos_o = clamp(at.x * at.x * at.x, SMALLEST_COSINE, LARGEST_COSINE);
    let root = mix(sqrt(sqrt(MIN_ALPHA)), 1.0, at.y);
    let alpha = root * root * root * root;
    let a2 = alpha * alpha;
    let w_o = vec3f(sqrt(1.0 - cos_o * cos_o), 0.0, cos_o);
    let stretched = normalize(vec3f(alpha * w_o.x, 0.0, w_o.z));
    let root_o = sqrt(a2 + (1.0 - a2) * cos_o * cos_o);

    var reflected = 0.0;
    var by_fresnel = 0.0;
    var direction = vec2f(0.0);  // across, up
    for (var i = 0u; i < HEIGHTS; i += 1u) {
        // The smoothest step q and its slope.
        let u = (f32(i) + 0.5) / f32(HEIGHTS);
        let q = u * u * u * (10.0 + u * (6.0 * u - 15.0));
        let slope = 30.0 * u * u * (1.0 - u) * (1.0 - u);
        let height = q * (1.0 + stretched.z);
        let z = height - stretched.z;
        let sine = sqrt(max(1.0 - z * z, 0.0));
        for (var j = 0u; j < TURNS; j += 1u) {
            let phi = PI * (f32(j) + 0.5) / f32(TURNS);
            let h = normalize(
                vec3f(alpha * (sine * cos(phi) + stretched.x), alpha * sine * sin(phi), height));
            let v_h = dot(w_o, h);
            let w_i = 2.0 * v_h * h - w_o;
            if (w_i.z > 0.0) {
                // f_r cos_i / pdf without Fresnel's factor: G2 / G1.
                let root_i = sqrt(a2 + (1.0 - a2) * w_i.z * w_i.z);
                let weight = slope * w_i.z * (cos_o + root_o) / (w_i.z * root_o + cos_o * root_i);
                reflected += weight;
                by_fresnel += weight * fresnel_schlick(vec3f(0.0), v_h).x;
                direction += weight * vec2f(-w_i.x, w_i.z);
            }
        }
    }
    let count = f32(HEIGHTS * TURNS);
    let mean_cosine = 1.0 - pow(max(by_fresnel / reflected, 1e-30), 0.2);
    let lean = normalize(direction).x / w_o.x;
    textureStore(table, id.xy, vec4f(reflected / count, mean_cosine, max(lean, 0.0), 1.0));
}
