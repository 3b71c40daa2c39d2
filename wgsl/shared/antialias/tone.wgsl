// Light compressed to x / (1 + luminance), so that bright samples count less in a mean (Karis 2014).
#import "common/math.wgsl"

// Light in units of `unit`, W/(m2 sr), compressed, as YCoCg.
fn compress(light: vec3f, unit: f32) -> vec3f {
    let rgb = min(light / unit, vec3f(1e18));
    let y = 0.25 * (rgb.r + rgb.b) + 0.5 * rgb.g;
    return vec3f(y, 0.5 * (rgb.r - rgb.b), 0.5 * rgb.g - 0.25 * (rgb.r + rgb.b)) / (1.0 + y);
}

// The inverse.
fn expand(code: vec3f, unit: f32) -> vec3f {
    let c = code / max(1.0 - code.x, 1e-6);
    let t = c.x - c.z;
    return unit * max(vec3f(t + c.y, c.x + c.z, t - c.y), vec3f(0.0));
}
