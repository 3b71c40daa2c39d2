// Directional albedos of the GGX coat, as fits over the cosine mu and alpha: what one scattering loses.
//
//   M(mu) = 1 - integral D V cos_i dw,         of a coat that absorbs nothing (F = 1): light that microfacets scatter again
//   T(mu) = 1 - integral F D V cos_i dw,       light that a dielectric coat transmits to its base, F0 = 0.04 and F90 = 1
// Fits instead of a table: they need no binding, and their cosine-weighted means over the hemisphere are known.
//   M = t (p0 + p1 mu) / (1 + q1 t + q2 t^2 + q3 t^3), t = mu / alpha
//   T = 1 - (1 - M) (0.04 + 0.96 (1 - g)^5), g = g0 + g1 mu + g2 s + g3 alpha / s, s^2 = alpha^2 + (1 - alpha^2) mu^2
// with coefficients that are polynomials of the roughness. T is linear in F0 and F90, so other dielectrics (HAS_SPECULAR)
// follow: T = 1 - (1 - M) (F0 + (F90 - F0) (1 - g)^5). `tools/fit_coat_albedo.py` finds them. Against quadrature, M
// errs by at most 0.0019 and T by 0.0022; with the errors of the means, a white furnace errs by at most 0.25 %.
#import "common/layers.wgsl"

// Reflectance of dielectrics at normal incidence (glTF 2.0, appendix B.2.1: index of refraction 1.5).
const DIELECTRIC_F0: f32 = 0.04;

// The fits' coefficients at one alpha.
struct CoatFit {
    missing: vec4f,           // p0, q1, q2, q3
    missing_slope: f32,       // p1
    fresnel_cosine: vec4f,    // g0 .. g3
    mean_missing: f32,        // 2 integral M mu dmu
    mean_transmitted: f32,    // 2 integral T mu dmu
    f0: f32,                  // of the dielectric, at normal and at grazing incidence
    f90: f32,
}

// M and T at one cosine.
struct CoatLoss {
    missing: f32,
    transmitted: f32,
}

fn no_coat() -> CoatFit {
    return CoatFit(vec4f(0.0), 0.0, vec4f(0.0), 1.0, 1.0, DIELECTRIC_F0, 1.0);
}

fn fit_coat(alpha: f32) -> CoatFit {
    let r = sqrt(alpha);
    var m = vec4f(5.080233, 152.4743, 574.2601, -89.94128);
    m = m * r + vec4f(-14.93351, -510.0998, -1147.311, 150.7116);
    m = m * r + vec4f(25.13765, 657.8431, 984.2983, -139.1304);
    m = m * r + vec4f(-13.32909, -360.4847, -315.3199, 78.87794);
    m = m * r + vec4f(4.079722, 119.3354, 4.212255, -5.532455);
    m = m * r + vec4f(-0.5192609, -16.99674, 8.361655, -1.947498);
    m = m * r + vec4f(0.2552687, 1.494719, -0.5034, 0.4916195);
    let slope = ((((169.5426 * r - 116.1978) * r + 35.79459) * r + 9.478456) * r - 2.937248) * r + 0.08176079;
    var g = vec4f(-2.925969, -4.498941, 3.516568, 0.7194398);
    g = g * r + vec4f(0.9608552, 15.11664, -10.46447, -0.4612555);
    g = g * r + vec4f(0.2824067, -17.7354, 14.75374, 0.261696);
    g = g * r + vec4f(-0.02744083, 8.880901, -8.644783, 0.1715836);
    g = g * r + vec4f(0.0004915503, -1.330395, 2.320657, -0.002557424);
    let mean_factor = ((0.4829435 * r - 0.5678726) * r + 0.1740635) * r + 0.5012265 - 1.375024 * log2(r);
    let mean_transmitted = (((0.1794542 * r - 0.4961548) * r + 0.4352644) * r - 0.0526072) * r + 0.915395;
    return CoatFit(m, slope, g, alpha * alpha * mean_factor, mean_transmitted, DIELECTRIC_F0, 1.0);
}

// Returns the fit of a dielectric of other reflectances. The mean of (1 - M) (1 - g)^5 follows from that of T.
fn fit_of_dielectric(plain: CoatFit, f0: f32, f90: f32) -> CoatFit {
    var fit = plain;
    let reflected = 1.0 - plain.mean_missing;
    let grazing = (1.0 - plain.mean_transmitted - DIELECTRIC_F0 * reflected) / (1.0 - DIELECTRIC_F0);
    // M + (1 - M)(1 - F0) instead of 1 - (1 - M) F0 keeps the digits of what a mirror transmits.
    let transmitted = plain.mean_missing + reflected * (1.0 - f0) - (f90 - f0) * grazing;
    fit.mean_transmitted = clamp(transmitted, 1e-6, 1.0);
    fit.f0 = f0;
    fit.f90 = f90;
    return fit;
}

// Cosines are clamped to 0 to 1: beyond it the fits have no bounds.
fn coat_loss(fit: CoatFit, alpha: f32, cosine: f32) -> CoatLoss {
    let mu = saturate(cosine);
    let t = mu / alpha;
    let m = fit.missing;
    let above = t * (m.x + fit.missing_slope * mu);
    let missing = max(above / (1.0 + t * (m.y + t * (m.z + t * m.w))), 0.0);
    let a2 = alpha * alpha;
    let s2 = a2 + (1.0 - a2) * mu * mu;
    let inverse = inverseSqrt(s2);
    let past = 1.0 - dot(fit.fresnel_cosine, vec4f(1.0, mu, s2 * inverse, alpha * inverse));
    let past2 = past * past;
    if (HAS_SPECULAR) {
        let reflected = fit.f0 + (fit.f90 - fit.f0) * (past2 * past2 * past);
        return CoatLoss(missing, missing + (1.0 - missing) * saturate(1.0 - reflected));
    }
    let reflected = DIELECTRIC_F0 + (1.0 - DIELECTRIC_F0) * (past2 * past2 * past);
    return CoatLoss(missing, 1.0 - (1.0 - missing) * reflected);
}
