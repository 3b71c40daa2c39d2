// The history's light between pixels by Catmull-Rom splines, which blur less than bilinear filtering: twelve of the 4x4
// taps, without the corners, as in Jimenez 2016, "Filmic SMAA". The result lies within the four nearest taps, since
// negative weights ring at edges. That errs bright beside thin lights.
#import "scene/info.wgsl"
#import "shared/antialias/history.wgsl"
#import "shared/antialias/tone.wgsl"

@group(1) @binding(14) var<storage, read> previous: array<vec4u>;  // the previous frame's history

fn history_index(pixel: vec2i) -> u32 {
    let inside = vec2u(clamp(pixel, vec2i(0), vec2i(view.size) - 1));
    return inside.y * view.size.x + inside.x;
}

// Weights of the taps at -1, 0, 1 and 2 for a place `f` beyond tap 0.
fn catmull_rom(f: f32) -> vec4f {
    return vec4f(
        f * (-0.5 + f * (1.0 - 0.5 * f)), 1.0 + f * f * (1.5 * f - 2.5), f * (0.5 + f * (2.0 - 1.5 * f)),
        f * f * (0.5 * f - 0.5));
}

// Returns compressed light and coverage at a place of the previous picture, pixels; `unit`: that of `compress`.
fn resample(place: vec2f, unit: f32) -> vec4f {
    let corner = vec2i(floor(place));
    let f = place - floor(place);
    let x = catmull_rom(f.x);
    let y = catmull_rom(f.y);
    var sum = vec4f(0.0);
    var weight = 0.0;
    var least = vec4f(FLOAT_MAX);
    var most = vec4f(-FLOAT_MAX);
    for (var k = 0; k < 16; k += 1) {
        let tap = vec2i(k & 3, k >> 2u);
        let central = (tap == vec2i(1)) | (tap == vec2i(2));
        if (!any(central)) {
            continue;
        }
        let texel = unpack_color(previous[history_index(corner + tap - 1)]);
        let color = vec4f(compress(texel.rgb, unit), texel.a);
        let w = x[tap.x] * y[tap.y];
        sum += w * color;
        weight += w;
        least = select(least, min(least, color), all(central));
        most = select(most, max(most, color), all(central));
    }
    return clamp(sum / weight, least, most);
}
