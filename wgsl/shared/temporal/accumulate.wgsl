// One invocation averages a pixel's irradiance over frames: mean += (x - mean) / k, for the k-th frame that shows its
// surface, at most `frames`, fewer where it moves.
//
// Where it was in the frame before says `motion`; of the four pixels there those are left out whose distance or normal
// says that they showed something else. Later frames of a still picture are left as they are: they are averaged anyway,
// and after the blur, which tells noise by how frames differ. In: irradiance W/m2, motion, what was kept. Out: irradiance, what is kept, and
// the share of it that was left out. Errs late where light changes, by `frames` at most.
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
@group(1) @binding(13) var<storage, read> before: array<vec4u>;
@group(1) @binding(14) var<storage, read_write> kept: array<vec4u>;
@group(1) @binding(15) var<storage, read_write> averaged: array<vec4f>;
@group(1) @binding(16) var<storage, read_write> rejected: array<f32>;

// Another surface, if its distance differs by this share of it. Chosen.
const SAME_DISTANCE: f32 = 0.02;
// or if the cosine of the normals is below this. Chosen.
const SAME_NORMAL: f32 = 0.9;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (any(id.xy >= view.size)) {
        return;
    }
    let index = id.y * view.size.x + id.x;
    let now = irradiance[index];
    if (now.w <= 0.0) {
        kept[index] = vec4u(0u);
        averaged[index] = vec4f(0.0);
        rejected[index] = 0.0;
        return;
    }
    let normal = load_surface(id.xy).normal;
    let moved = motion[index];
    let place = vec2f(id.xy) - moved.xy;
    let corner = vec2i(floor(place));
    let f = place - floor(place);
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
        let h = unpack_history(before[u32(pixel.y) * view.size.x + u32(pixel.x)]);
        let same = h.frames > 0.0 && abs(h.distance - moved.z) <= SAME_DISTANCE * moved.z
            && dot(h.normal, normal) >= SAME_NORMAL;
        let w = select(0.0, share.x * share.y, same);
        light += w * h.light;
        frames += w * h.frames;
        weight += w;
    }
    // With less than a tenth of a pixel found again, noise would be all that is.
    let found = weight > 0.1;
    let most = max(params.frames / (1.0 + params.speed * length(moved.xy)), 1.0);
    let count = select(1.0, min(round(frames / max(weight, 0.1)) + 1.0, most), found);
    let mean = mix(select(now.rgb, light / max(weight, 0.1), found), now.rgb, 1.0 / count);
    averaged[index] = vec4f(select(mean, now.rgb, sequence.index > 0u), now.w);
    kept[index] = pack_history(History(mean, count, load_distance(id.xy), normal));
    rejected[index] = 1.0 - weight;
}
