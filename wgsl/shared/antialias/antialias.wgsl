// One invocation averages a pixel's radiance over jittered frames: mean += (x - mean) / n along reprojected pixels.
//
// Beside an edge, the reprojection follows the surface in front, so that silhouettes keep their samples. A history that
// shows only nearer surfaces is dropped, and in motion any beside lamps, which would spread; others are clipped to
// mean +- CLIP deviations of the 3x3 pixels around (Salvi 2016, "An Excursion in Temporal Supersampling"). All that in
// YCoCg of compressed light (`tone.wgsl`; Karis 2014, "High-Quality Temporal Supersampling"). In: radiance and emission
// W/(m2 sr), radiance with coverage; motion; distance. Out: the same radiance, anti-aliased; the history. Errs dark
// where a pixel shows light and dark. At rest, lamps thinner than it lose most: the clip removes what jitter misses.
#import "shared/gbuffer/distance.wgsl"
#import "shared/antialias/resample.wgsl"

struct Params {
    frames: f32,  // of the mean
}

@group(1) @binding(10) var<uniform> params: Params;
@group(1) @binding(11) var<storage, read> radiance: array<vec4f>;
@group(1) @binding(12) var<storage, read> motion: array<vec4f>;
@group(1) @binding(13) var<storage, read> emission: array<vec4f>;
@group(1) @binding(15) var<storage, read_write> history: array<vec4u>;
@group(1) @binding(16) var<storage, read_write> picture: array<vec4f>;

const MOVES: f32 = 1.0 / 64.0;      // pixels: less is the rounding of a still surface's motion
const SAME_DISTANCE: f32 = 0.02;    // relative: more than the steps of the packed distance, 0.4 %
const EDGE: f32 = 0.98;             // ratio of the distances at an edge
const CLIP: f32 = 1.0;              // standard deviations
const GLARE: f32 = 4.0;             // ratio of a lamp's light to that beside it
const ROUNDING: f32 = 1e-4;         // of packed light, relative: surfaces of one colour have no deviation
const SMALLEST: f32 = 1e-30;

fn pixel_index(pixel: vec2u) -> u32 {
    return pixel.y * view.size.x + pixel.x;
}

// The 3x3 pixels around one.
struct Around {
    unit: f32,         // of compressed light, W/(m2 sr)
    mean: vec3f,       // of compressed light
    deviation: vec3f,
    darkest: f32,      // the least luminance, W/(m2 sr)
    lamp: f32,         // the largest luminance of surfaces that emit
    coverage: vec2f,   // least and most
    closest: vec2u,    // the pixel with the nearest surface
    least: f32,        // its distance, metres
    farthest: f32,     // the largest distance, metres
}

fn look_around(pixel: vec2u) -> Around {
    let last = vec2i(view.size) - 1;
    var a = Around(0.0, vec3f(0.0), vec3f(0.0), FLOAT_MAX, 0.0, vec2f(1.0, 0.0), pixel, FLOAT_MAX, 0.0);
    var lights: array<vec3f, 9>;
    for (var k = 0; k < 9; k += 1) {
        let tap = vec2u(clamp(vec2i(pixel) + vec2i(k % 3, k / 3) - 1, vec2i(0), last));
        let seen = load_distance(tap);
        let far = select(SKY_DISTANCE, seen, seen > 0.0);
        a.closest = select(a.closest, tap, far < a.least);
        a.least = min(a.least, far);
        a.farthest = max(a.farthest, far);
        let light = radiance[pixel_index(tap)];
        a.coverage = vec2f(min(a.coverage.x, light.a), max(a.coverage.y, light.a));
        lights[k] = light.rgb;
        a.darkest = min(a.darkest, luminance(light.rgb));
        let emitted = emission[pixel_index(tap)];
        a.lamp = max(a.lamp, select(luminance(emitted.rgb), 0.0, emitted.a > 0.0));
        a.unit += min(luminance(light.rgb), 1e34) / 9.0;
    }
    // Beside lamps, light is hardly compressed, or they would vanish.
    a.unit = max(select(a.unit, 16.0 * a.lamp, a.lamp > GLARE * a.darkest), SMALLEST);
    for (var k = 0; k < 9; k += 1) {
        let code = compress(lights[k], a.unit);
        a.mean += code / 9.0;
        a.deviation += code * code / 9.0;
    }
    a.deviation = sqrt(max(a.deviation - a.mean * a.mean, vec3f(0.0)));
    return a;
}

// Returns the history of a pixel, 0 frames if it has none; `place`: where its surface was, pixels.
fn find_history(moved: vec4f, place: vec2f) -> History {
    let nearest = vec2i(round(place));
    var h = History(vec3f(0.0), 0.0, 0.0, 0.0);
    if (moved.w <= 0.0 || any(nearest < vec2i(0)) || any(nearest >= vec2i(view.size))) {
        return h;
    }
    h = unpack_history(previous[history_index(nearest)]);
    // Only nearer surfaces were there: they hid this one.
    let distance_before = select(SKY_DISTANCE, moved.z, moved.z > 0.0);
    if (distance_before > h.farthest * (1.0 + SAME_DISTANCE)) {
        h.frames = 0.0;
    }
    return h;
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (any(id.xy >= view.size)) {
        return;
    }
    let index = pixel_index(id.xy);
    let now = radiance[index];
    let a = look_around(id.xy);
    // Follow the surface to the previous frame; beside an edge, the surface in front.
    let seen = load_distance(id.xy);
    let own = select(SKY_DISTANCE, seen, seen > 0.0);
    let moved = motion[pixel_index(select(id.xy, a.closest, a.least < EDGE * own))];
    let still = all(abs(moved.xy) < vec2f(MOVES));
    let place = vec2f(id.xy) - select(moved.xy, vec2f(0.0), still);
    var h = find_history(moved, place);
    // Resampling in motion would blur lamps over what is beside them.
    if (!still && a.lamp > GLARE * a.darkest) {
        h.frames = 0.0;
    }
    let count = min(h.frames + 1.0, params.frames);
    var color = now;
    if (count > 1.0) {
        var before = vec4f(compress(h.light, a.unit), h.coverage);
        if (!still) {
            before = resample(place, a.unit);
        }
        // Clip the history along the line to the mean of the pixels around.
        let off = before.xyz - a.mean;
        let beyond = abs(off) / (CLIP * a.deviation + ROUNDING * max(a.mean.x, SMALLEST));
        let clipped = vec4f(a.mean + off / max(max3(beyond), 1.0), clamp(before.w, a.coverage.x, a.coverage.y));
        // Average.
        let mean = mix(clipped, vec4f(compress(now.rgb, a.unit), now.a), 1.0 / count);
        color = vec4f(expand(mean.xyz, a.unit), mean.w);
    }
    history[index] = pack_history(History(color.rgb, color.a, count, a.farthest));
    picture[index] = color;
}
