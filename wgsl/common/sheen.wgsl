// Sheen of cloth (KHR_materials_sheen): Estevez and Kulla 2017, "Production Friendly Microfacet Sheen BRDF".
//
//   f = c D V s,  D = (2 + 1/a) sin(h)^(1/a) / (2 pi),  V = 1 / ((1 + Lambda(i) + Lambda(o)) 4 cos_i cos_o),  a = roughness^2
// Below it: times min(p(w_i), p(w_o)), p = 1 - max(c) min(E, 1), E the integral of D V cos (albedo scaling). E is above 1
// at grazing angles if the roughness is small, so s = 1 / max(1, E(i), E(o)): Khronos' formulas gain light there.
// E is a fit, `tools/fit_sheen_albedo.py`; it errs by at most 0.0072, which FIT_MARGIN adds. Errs dark, by at most 0.015.
#import "common/math.wgsl"

const MIN_SHEEN_ROUGHNESS: f32 = 0.07;
const FIT_MARGIN: f32 = 0.0075;

// Returns the exponent of Lambda, section 3; `share`: (1 - a)^2.
fn sheen_exponent(share: f32, x: f32) -> f32 {
    let a = mix(21.5473, 25.3245, share);
    let b = mix(3.82987, 3.32435, share);
    let c = mix(0.19823, 0.16801, share);
    let d = mix(-1.97760, -1.27393, share);
    let e = mix(-4.32054, -4.85967, share);
    return a / (1.0 + b * pow(max(x, 1e-6), c)) + d * x + e;
}

fn sheen_lambda(alpha: f32, cosine: f32) -> f32 {
    let share = (1.0 - alpha) * (1.0 - alpha);
    if (cosine < 0.5) {
        return exp(sheen_exponent(share, cosine));
    }
    return exp(2.0 * sheen_exponent(share, 0.5) - sheen_exponent(share, 1.0 - cosine));
}

// Returns E, at most 0.0003 below the truth up to 1.
fn sheen_albedo(alpha: f32, cosine: f32) -> f32 {
    let q = sqrt(sqrt(alpha));
    let x = pow(clamp(cosine, 1e-4, 1.0), 1.0 / 3.0);
    var k = vec4f(-31.34007, 118.6525, -623.7039, 1899.233);
    k = k * q + vec4f(89.48634, -341.1889, 1821.445, -5965.227);
    k = k * q + vec4f(-101.8466, 367.5957, -1990.384, 7184.811);
    k = k * q + vec4f(64.8364, -186.5803, 992.8018, -4110.566);
    k = k * q + vec4f(-26.21952, 43.7768, -195.3835, 1067.274);
    k = k * q + vec4f(4.677846, 1.536436, -17.90897, -60.85226);
    var k4 = ((-1107.304 * q + 3318.693) * q - 3660.088) * q + 1733.448;
    k4 = (k4 * q - 246.8857) * q - 44.62802;
    return exp(min((((k4 * x + k.w) * x + k.z) * x + k.y) * x + k.x, 3.0)) + FIT_MARGIN;
}

// Returns the cosine-weighted mean of min(E, 1) over the hemisphere; errs by 0.0001.
fn mean_sheen_albedo(alpha: f32) -> f32 {
    let r = sqrt(alpha);
    return ((((0.35627 * r - 1.3453) * r + 1.3701) * r - 0.34877) * r + 0.27156) * r - 0.0042369;
}

// Returns the share of light in a direction that passes to what is below.
fn sheen_passes(color: vec3f, alpha: f32, cosine: f32) -> f32 {
    return 1.0 - saturate(max3(color) * min(sheen_albedo(alpha, cosine), 1.0));
}

// Returns f_r; w_i, w_o above the surface.
fn evaluate_sheen(color: vec3f, alpha: f32, w_o: vec3f, w_i: vec3f) -> vec3f {
    let cos_h = (w_i.z + w_o.z) * inverseSqrt(max(2.0 + 2.0 * dot(w_i, w_o), 1e-12));
    let sine2 = saturate(1.0 - cos_h * cos_h);
    let distribution = (2.0 + 1.0 / alpha) * pow(max(sine2, 1e-12), 0.5 / alpha) / TWO_PI;
    // The fit of E begins at 1e-4.
    let cos_i = max(w_i.z, 1e-4);
    let cos_o = max(w_o.z, 1e-4);
    let shadowed = 1.0 + sheen_lambda(alpha, cos_i) + sheen_lambda(alpha, cos_o);
    let visibility = 0.25 / (shadowed * cos_i * cos_o);
    let most = max(1.0, max(sheen_albedo(alpha, cos_i), sheen_albedo(alpha, cos_o)));
    return color * (distribution * visibility / most);
}

// Returns the density of sample_sheen, 1/sr: r / (2 pi atan(1 / r) (cos^2 + r^2)), about that of f_r cos.
fn sheen_pdf(alpha: f32, cosine: f32) -> f32 {
    let r = sqrt(alpha);
    return r / (TWO_PI * atan(1.0 / r) * (cosine * cosine + alpha));
}

fn sample_sheen(alpha: f32, u: vec2f) -> vec3f {
    let r = sqrt(alpha);
    let z = min(r * tan(u.x * atan(1.0 / r)), 1.0);
    let sine = sqrt(max(1.0 - z * z, 0.0));
    return vec3f(sine * cos(TWO_PI * u.y), sine * sin(TWO_PI * u.y), max(z, 1e-6));
}
