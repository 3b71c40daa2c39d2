// Directional albedos of an anisotropic GGX lobe, as bounds: M at most, B at least those of quadrature, so that no surface
// gains light.
//
//   M = M_iso(mu, a) exp(k P),  a^2 = (a_x^2 + a_y^2) / 2;  B = B_iso(mu, |(a_x cos phi, a_y sin phi)|) exp(k Q)
// M = 1 - integral D V cos, B = integral D V cos (1 - v.h)^5, k = 1 - a_y / a_x; P and Q are polynomials of second degree in
// sqrt(a), cos^2 phi, k and a term in mu. `tools/fit_anisotropy.py` finds them. M is up to 0.10 too small, so metals that are
// stretched most lose so much light; B is up to 0.06 too large, which bases under such coats lose.
#import "common/coat_albedo.wgsl"

// Returns a polynomial of second degree in q, x, c and k, by the coefficients as the tool prints them.
fn second_degree(a: array<f32, 15>, q: f32, x: f32, c: f32, k: f32) -> f32 {
    return a[0] + k * (a[1] + a[2] * k) + c * (a[3] + a[4] * k + a[5] * c) + x * (a[6] + a[7] * k + a[8] * c + a[9] * x)
        + q * (a[10] + a[11] * k + a[12] * c + a[13] * x + a[14] * q);
}

fn third_degree(a: array<f32, 10>, q: f32, k: f32) -> f32 {
    return a[0] + k * (a[1] + k * (a[2] + k * a[3])) + q * (a[4] + k * (a[5] + k * a[6]) + q * (a[7] + k * a[8] + q * a[9]));
}

fn mean_width(axes: vec2f) -> f32 {
    return sqrt(0.5 * dot(axes, axes));
}

// Returns the fit for anisotropic_loss: that of the mean width, with means of the anisotropic lobe. M's is at least, T's at
// least that of the bounds.
fn fit_anisotropic(axes: vec2f, f0: f32, f90: f32) -> CoatFit {
    let alpha = mean_width(axes);
    let plain = fit_coat(alpha);
    let k = 1.0 - axes.y / axes.x;
    let q = sqrt(alpha);
    let m = array<f32, 10>(
        -30.07062, 11.20252, 1.611559, -1.282974, 101.9118, -27.24806, -0.02950436, -119.4977, 16.97173, 47.18068);
    let b = array<f32, 10>(
        0.6013048, 2.353396, -3.387217, 1.081451, -1.229007, -5.381631, 4.43588, 12.44611, -5.017753, -3.466018);
    var fit = plain;
    let reflected = 1.0 - plain.mean_missing;
    let grazing = (1.0 - plain.mean_transmitted - DIELECTRIC_F0 * reflected) / (1.0 - DIELECTRIC_F0);
    fit.mean_missing = min(
        max(plain.mean_missing, 0.004) * exp(k * third_degree(m, q, k)) + min(0.005, 0.05 * k), 1.0);
    let mean_grazing = max(max(grazing, 0.004) * exp(k * third_degree(b, q, k)) - 0.001, 0.0);
    fit.mean_transmitted = clamp(1.0 - f0 * (1.0 - fit.mean_missing) - (f90 - f0) * mean_grazing, 1e-3, 1.0);
    fit.f0 = f0;
    fit.f90 = f90;
    return fit;
}

// Returns M and T of a direction in the lobe's axes. `fit`: of fit_anisotropic.
fn anisotropic_loss(fit: CoatFit, axes: vec2f, w: vec3f) -> CoatLoss {
    let alpha = mean_width(axes);
    let mu = saturate(abs(w.z));
    let k = 1.0 - axes.y / axes.x;
    let q = sqrt(alpha);
    let flat = dot(w.xy, w.xy);
    let c = select(0.5, w.x * w.x / max(flat, 1e-30), flat > 1e-12);
    let p = array<f32, 15>(
        2.306818, -0.1860875, -0.4991838, -1.879275, 0.2508135, 0.5587425, -7.544812, 1.59421, 2.422754, 3.112504,
        -0.8701179, 0.1850521, -0.389614, 2.67478, 0.1186801);
    let plain = coat_loss(fit, alpha, mu).missing;
    let missing = plain * exp(k * second_degree(p, q, mu / (mu + alpha), c, k)) - min(0.0494, 0.1516 * k);
    let r = array<f32, 15>(
        -0.06463046, -0.3677955, -1.583012, -0.1834528, -5.57322, 0.3616245, 0.5038743, 1.624288, -0.2612585, -0.3999387,
        0.3684611, 1.210643, 6.017567, -2.284112, 0.3780274);
    let towards = sqrt(axes.x * axes.x * c + axes.y * axes.y * (1.0 - c));
    let loss = coat_loss(fit_coat(towards), towards, mu);
    let b = (1.0 - loss.transmitted - DIELECTRIC_F0 * (1.0 - loss.missing)) / (1.0 - DIELECTRIC_F0);
    let x = pow(max(mu, 1e-12), 1.0 / 3.0);
    // r's last variable is sqrt(towards) in place of k.
    let grazing = b * exp(k * second_degree(r, q, x, c, sqrt(towards))) + min(0.0293, 0.0517 * k);
    let least = saturate(missing);
    return CoatLoss(least, saturate(1.0 - fit.f0 * (1.0 - least) - (fit.f90 - fit.f0) * grazing));
}
