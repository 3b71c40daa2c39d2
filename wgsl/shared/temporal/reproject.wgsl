// One invocation averages a pixel's irradiance over frames by reprojection: mean += (x - mean) / k. k counts the frames
// that show the surface, up to `frames`, or fewer where it moves.
//
// `motion` gives the previous position; of the four taps there, those whose distance or normal disagrees get weight 0
// (history rejection). Later frames of a still picture pass through: a pass after the blur averages them, because the
// blur tells noise from detail by the variance over frames. In: irradiance W/m2, motion, the previous history. Out:
// mean irradiance, W/m2, the history, and its rejected share. Lags where light changes, by at most `frames` frames.
#import "shared/gbuffer/load.wgsl"
#import "shared/temporal/history.wgsl"
#import "scene/sequence.wgsl"

struct Params {
    frames: f32,
    speed: f32,  // `frames` is divided by 1 + `speed` times the pixels that the surface moves
}

@group(1) @binding(10) var<uniform> params: Params;
@group(1) @binding(11) var<storage, read> irradiance: array<vec4f>;
@group(1) @binding(12) var<storage, read> motion: array<vec4f>;
@group(1) @binding(13) var<storage, read> previous: array<vec4u>;        // the previous frame's history
@group(1) @binding(14) var<storage, read_write> history: array<vec4u>;
@group(1) @binding(15) var<storage, read_write> averaged: array<vec4f>;
@group(1) @binding(16) var<storage, read_write> rejected: array<f32>;

// A tap shows the same surface if distances differ by at most this share and the normals' cosine is at least this (26
// degrees). tools/README.md, "Constants".
const MAX_DISTANCE_CHANGE: f32 = 0.02;
const MIN_NORMAL_COSINE: f32 = 0.9;
// The history is dropped if accepted taps weigh less than this: less than a tenth of a pixel is mostly noise.
// tools/README.md, "Constants".
const MIN_HISTORY_WEIGHT: f32 = 0.1;

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
        rejected[index] = 0.0;
        return;
    }
    let normal = load_surface(id.xy).normal;
    let moved = motion[index];
    let place = vec2f(id.xy) - moved.xy;
    let corner = vec2i(floor(place));
    let f = place - floor(place);
    // Filter the history bilinearly over the taps that show the same surface.
    var light = vec3f(0.0);
    var frames = 0.0;
    var weight = 0.0;
    for (var k = 0; k < 4; k += 1) {
        let offset = vec2i(k & 1, k >> 1u);
        let pixel = corner + offset;
        let share = select(1.0 - f, f, offset > vec2i(0));
        let inside = all(pixel >= vec2i(0)) && all(pixel < vec2i(view.size));
        if (!inside || moved.w <= 0.0) {
            continue;
        }
        let h = unpack_history(previous[u32(pixel.y) * view.size.x + u32(pixel.x)]);
        let same = h.frames > 0.0 && abs(h.distance - moved.z) <= MAX_DISTANCE_CHANGE * moved.z
            && dot(h.normal, normal) >= MIN_NORMAL_COSINE;
        let w = select(0.0, share.x * share.y, same);
        light += w * h.light;
        frames += w * h.frames;
        weight += w;
    }
    // Blend the new value into the history, or start over.
    let found = weight > MIN_HISTORY_WEIGHT;
    let most = max(params.frames / (1.0 + params.speed * length(moved.xy)), 1.0);
    let count = select(1.0, min(round(frames / max(weight, MIN_HISTORY_WEIGHT)) + 1.0, most), found);
    let mean = mix(select(now.rgb, light / max(weight, MIN_HISTORY_WEIGHT), found), now.rgb, 1.0 / count);
    averaged[index] = vec4f(select(mean, now.rgb, sequence.still > 0u), now.w);
    history[index] = pack_history(History(mean, count, load_distance(id.xy), normal));
    rejected[index] = 1.0 - weight;
}
