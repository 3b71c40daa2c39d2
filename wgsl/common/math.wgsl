// Constants, orthonormal frames and octahedral codes.

const PI: f32 = 3.14159265358979;
const TWO_PI: f32 = 6.28318530717959;
const INV_PI: f32 = 0.318309886183791;
const FLOAT_MAX: f32 = 3.4e38;
const SMALLEST_NORMAL: f32 = 1.1754944e-38;  // 2^-126; below it GPUs may flush to zero, and inverses overflow

// Rec. 709 luminance.
fn luminance(color: vec3f) -> f32 {
    return dot(color, vec3f(0.2126, 0.7152, 0.0722));
}

fn max3(v: vec3f) -> f32 {
    return max(v.x, max(v.y, v.z));
}

// Returns whether no component is infinite or NaN. Tests the exponents' bits: WGSL may assume that NaN does not occur.
fn is_finite(v: vec3f) -> bool {
    return all((bitcast<vec3u>(v) & vec3u(0x7f800000u)) != vec3u(0x7f800000u));
}

// Returns v / |v|, or `fallback` where v has no direction: zero, infinite or NaN.
fn normalize_or(v: vec3f, fallback: vec3f) -> vec3f {
    let size = max3(abs(v));
    if (!is_finite(v) || size < SMALLEST_NORMAL) {
        return fallback;
    }
    // Scaling first keeps the squares of tiny and huge vectors in range.
    let scaled = v / size;
    return scaled * inverseSqrt(dot(scaled, scaled));
}

// Returns tangent, bitangent and unit n as columns (Duff et al. 2017, "Building an Orthonormal Basis, Revisited").
fn frame_from_normal(n: vec3f) -> mat3x3f {
    let s = select(-1.0, 1.0, n.z >= 0.0);
    let a = -1.0 / (s + n.z);
    let b = n.x * n.y * a;
    return mat3x3f(vec3f(1.0 + s * n.x * n.x * a, s * b, -s * n.x), vec3f(b, s + n.y * n.y * a, -n.y), n);
}

// Returns the unit vector of an octahedral code in [-1, 1]^2 (Cigolle et al. 2014).
fn octahedral_decode(code: vec2f) -> vec3f {
    var v = vec3f(code, 1.0 - abs(code.x) - abs(code.y));
    let fold = max(-v.z, 0.0);
    v.x += select(fold, -fold, v.x >= 0.0);
    v.y += select(fold, -fold, v.y >= 0.0);
    return normalize(v);
}

// Returns the octahedral code in [-1, 1]^2 of a unit vector.
fn octahedral_encode(v: vec3f) -> vec2f {
    let p = v.xy / (abs(v.x) + abs(v.y) + abs(v.z));
    let folded = (1.0 - abs(p.yx)) * select(vec2f(-1.0), vec2f(1.0), p >= vec2f(0.0));
    return select(p, folded, v.z < 0.0);
}
