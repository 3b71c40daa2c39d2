// One invocation averages a pixel's light over frames: mean += (x - mean) / k. k counts the frames that show the surface,
// up to 1 / (1 - 0.1^(1/frames)): a step of light is 90 % there after `frames` frames.
//
// Where light has changed, the history follows at once: its mean over neighbours on the same surface is clipped to that
// of this frame +- BOUND times its usual change. Noise that neighbours share changes their mean, too, so its change over
// time counts, not only the variance among them. A short history is filled from the means of the neighbours. Later frames of a still picture pass through: a pass after the blur averages them, because the blur tells
// noise from detail by the variance over frames. In: light, the history at the pixel. Out: mean light, the history.
// Errs blurry for the first frames of a surface, and lags where light changes by less than its noise, by at most
// `frames` frames.
#import "shared/gbuffer/load.wgsl"
#import "shared/temporal/history.wgsl"
#import "shared/denoise/plane.wgsl"
#import "scene/sequence.wgsl"

override COAT: bool = false;  // the light is what coats or metals reflect

struct Params {
    frames: f32,
    speed: f32,  // `frames` is divided by 1 + `speed` times the pixels that the surface moves
    step: i32,   // distance of neighbours, pixels: noise is independent that far apart
}

@group(1) @binding(10) var<uniform> params: Params;
@group(1) @binding(11) var<storage, read> irradiance: array<vec4f>;
@group(1) @binding(12) var<storage, read> motion: array<vec4f>;
@group(1) @binding(13) var<storage, read> found: array<vec4u>;
@group(1) @binding(16) var<storage, read> usual: array<vec2f>;  // spread and random numbers of the history
@group(1) @binding(14) var<storage, read_write> history: array<vec4u>;
@group(1) @binding(15) var<storage, read_write> averaged: array<vec4f>;

// Neighbours on a side; with steps that are odd, their 16 pixels are one of each class of interleaved sampling.
const SIDE: i32 = 4;
const MAX_PLANE_DISTANCE: f32 = 1.0;   // pixel widths
const MIN_NORMAL_COSINE: f32 = 0.9;
const BOUND: f32 = 3.0;                // standard deviations
const MIN_NEIGHBOURS: f32 = 6.0;       // with fewer, the standard error is not known
const MIN_FRAMES: f32 = 4.0;           // with fewer, the usual change is not known
const FILLED_FRAMES: f32 = 3.0;        // the share of the neighbours falls to 0 over as many frames
const MOVES: f32 = 0.01;               // pixels: less is the rounding of a still surface's motion

// Sums over a pixel's neighbours on the same surface.
struct Around {
    count: f32,          // those with a history
    now: vec3f,          // their light
    before: vec3f,       // their history
    squared: f32,        // squared difference of luminance
    mean: vec3f,         // light of all frames of all
    frames: f32,         // number of these frames
    old_frames: f32,     // of histories
}

fn look_around(pixel: vec2u, own: Found, surface_normal: vec3f) -> Around {
    let plane = tangent_plane(pixel, own.depth, to_view(surface_normal));
    let normal = unpack_view_normal(own.normal);
    var a = Around(0.0, vec3f(0.0), vec3f(0.0), 0.0, vec3f(0.0), 0.0, 0.0);
    for (var k = 0; k < SIDE * SIDE; k += 1) {
        let offset = (vec2i(k % SIDE, k / SIDE) - SIDE / 2) * params.step + params.step / 2;
        let tap = vec2i(pixel) + offset;
        if (any(tap < vec2i(0)) || any(tap >= vec2i(view.size))) {
            continue;
        }
        let place = vec2u(tap);
        let index = place.y * view.size.x + place.x;
        let h = unpack_found(found[index]);
        let off_plane = abs(plane.at + dot(plane.across, vec2f(offset)) - plane.factor * h.depth);
        let cosine = dot(unpack_view_normal(h.normal), normal);
        if (h.depth <= 0.0 || off_plane > MAX_PLANE_DISTANCE || cosine < MIN_NORMAL_COSINE) {
            continue;
        }
        let x = irradiance[index].rgb;
        let tent = 1.0 - abs(vec2f(offset)) / f32(SIDE / 2 * params.step);
        let near = tent.x * tent.y;
        a.mean += near * (h.frames * h.light + x);
        a.frames += near * (h.frames + 1.0);
        a.old_frames += near * h.frames;
        if (h.frames > 0.0) {
            let difference = luminance(x) - luminance(h.light);
            a.count += 1.0;
            a.now += x;
            a.before += h.light;
            a.squared += difference * difference;
        }
    }
    return a;
}

// Returns the history, moved by as much as its mean over the neighbours must move to lie within the bound, and its new
// spread. Light falls by a factor and rises by an amount, so that it stays positive; each channel by its own share, so
// that hues are right.
fn clipped(h: Found, spread: f32, a: Around, count: f32) -> vec4f {
    if (a.count < MIN_NEIGHBOURS) {
        return vec4f(h.light, spread);
    }
    let before = max(luminance(a.before), 1e-37);
    let change = luminance(a.now) / before - 1.0;
    let variance = max(a.squared * a.count / (before * before) - change * change, 0.0) / (a.count - 1.0);
    let bound = BOUND * max(sqrt(variance), spread);
    let share = select(0.0, max(1.0 - bound / max(abs(change), 1e-37), 0.0), h.frames >= MIN_FRAMES);
    let factor = a.now / max(a.before, vec3f(1e-37));
    let risen = h.light + share * (a.now - a.before) / a.count;
    let light = select(h.light * mix(vec3f(1.0), factor, share), risen, a.now > a.before);
    // A change beyond the bound is no noise.
    let noise = min(abs(change), select(1e9, bound, h.frames >= MIN_FRAMES));
    return vec4f(light, sqrt(mix(spread * spread, noise * noise, 1.0 / max(count - 1.0, 1.0))));
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (any(id.xy >= view.size)) {
        return;
    }
    let index = id.y * view.size.x + id.x;
    let now = irradiance[index];
    if (now.w <= 0.0) {
        history[index] = vec4u(0u);
        averaged[index] = vec4f(0.0);
        return;
    }
    // Blend the new light into the history, or start over. Light that is drawn again counts once.
    let h = unpack_found(found[index]);
    let before = usual[index];
    let moved = length(motion[index].xy);
    let surface = load_surface(id.xy);
    var a = Around(0.0, vec3f(0.0), vec3f(0.0), 0.0, vec3f(0.0), 0.0, 0.0);
    if (!COAT) {
        a = look_around(id.xy, h, surface.geometric_normal);
    }
    // Reflections do not move with their surface: average over no more frames than they take to move by a lobe's width.
    let lobe = surface.roughness * surface.roughness * f32(view.whole.y) / (2.0 * length(view.up));
    let speed = params.speed + select(0.0, 1.0 / max(lobe, 1e-3), COAT);
    let most = 1.0 / (1.0 - pow(0.1, (1.0 + speed * moved) / params.frames));
    let drawn = sequence.index & 3u;
    var count = max(min(h.frames + 1.0, most), 1.0);
    count = select(count, 1.0, params.frames <= 1.0);
    let followed = clipped(h, before.x, a, count);
    var mean = select(now.rgb, mix(followed.rgb, now.rgb, 1.0 / count), h.frames > 0.0);
    var spread = select(0.0, followed.w, h.frames > 0.0);
    if (h.frames > 0.0 && u32(before.y) == drawn) {
        count = h.frames;
        mean = h.light;
        spread = before.x;
    }
    history[index] = pack_history(
        History(mean, count, load_distance(id.xy), surface.normal, spread, drawn));
    // Fill a short history. The first frame of a picture, without any history, is shown as it is.
    let known = a.frames > 0.0 && (a.old_frames > 0.0 || moved > MOVES);
    let share = select(0.0, clamp(1.0 - (count - 1.0) / FILLED_FRAMES, 0.0, 1.0), known);
    let filled = mix(mean, (a.mean + count * mean) / max(a.frames + count, 1.0), share);
    averaged[index] = vec4f(select(filled, now.rgb, sequence.still > 0u), now.w);
}
