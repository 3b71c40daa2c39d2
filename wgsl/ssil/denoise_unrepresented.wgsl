// One invocation averages the irradiance of an unrepresented pixel over such pixels of the same surface around it.
//
// mean = sum_k tent_k s_k g_k E_k / sum_k tent_k s_k g_k, s_k the similarity of both surfaces by
// `shared/upsample/weights.wgsl`, and in still pictures g_k = max(1 - (l - l_k)^2 / (s^2 (v + v_k)), 0), l the mean
// luminance of the frames so far and v its variance (as `shared/denoise/neighbours.wgsl`). Unrepresented pixels lie along
// edges and creases; light changes little along these.
//
// In: surfels; irradiance, W/m2, 1 in w where unrepresented, 0 elsewhere; moments. Out: irradiance, W/m2. Errs blurry
// where light changes by less than its noise.
#import "shared/upsample/weights.wgsl"
#import "shared/upsample/unrepresented.wgsl"
#import "shared/denoise/guide.wgsl"
#import "ssil/guide_surface.wgsl"

override GUIDED: bool = false;  // compare mean light

@group(1) @binding(11) var surfels: texture_2d<u32>;
@group(1) @binding(12) var<storage, read> irradiance: array<vec4f>;
@group(1) @binding(13) var<storage, read_write> denoised: array<vec4f>;
@group(1) @binding(14) var<storage, read> known_moments: array<vec4f>;
@group(1) @binding(15) var<storage, read_write> moments: array<vec4f>;  // of luminance: mean, mean square; frames

// Half-width of the tent, pixels. One frame, 160x90, mean of 4 seeds, relMSE unfiltered / 3 / 4: courtyard .083, .062,
// .060, Sponza's gallery 4.08, 3.39, 3.36, Sponza (a) 2.38, 2.52, 2.72: in its small parts, light changes from pixel to
// pixel, and dark pixels take the light of bright ones.
const RADIUS: i32 = 3;
// Distance off the plane at which similarities reach 0, pixel widths. Sponza (a), one frame, 1 and 0.25: relMSE 2.54,
// 2.31.
const MOST_OFF_PLANE: f32 = 0.25;
// s. Cornell, point light, 24 frames, 1, 2 and 3: relMSE .0116, .0114, .0115.
const STANDARD_ERRORS: f32 = 2.0;

// Averages the luminance and its square over those frames of a still picture in which the pixel is unrepresented.
@compute @workgroup_size(64, 4)
fn find_moments(@builtin(global_invocation_id) id: vec3u) {
    if (any(id.xy >= view.size)) {
        return;
    }
    let index = id.y * view.size.x + id.x;
    let light = irradiance[index];
    // Frame 0 starts over. Values above 1e18 have squares whose sums overflow float32.
    var before = select(vec4f(0.0), moments[index], sequence.still > 0u);
    if (light.w > 0.0) {
        let now = min(luminance(light.rgb), 1e18);
        before.z += 1.0;
        before += vec4f(vec2f(now, now * now) - before.xy, 0.0, 0.0) / before.z;
    }
    moments[index] = before;
}

// Returns the mean luminance of a pixel and the variance of that mean.
fn mean_of(index: u32) -> vec2f {
    if (!GUIDED) {
        return vec2f(0.0);
    }
    let m = known_moments[index];
    let variance = max(m.y - m.x * m.x, 0.0) / max(m.z - 1.0, 1.0);
    return vec2f(m.x, select(variance, m.y, m.z < f32(GUIDED_FROM)));
}

// Returns g_k.
fn same_light(own: vec2f, tap: vec2f) -> f32 {
    let apart = own.x - tap.x;
    let noise = STANDARD_ERRORS * STANDARD_ERRORS * (own.y + tap.y);
    let same = max(1.0 - apart * apart / max(noise, 1e-37), 0.0);
    return select(1.0, same, GUIDED & (sequence.still >= GUIDED_FROM));
}

@compute @workgroup_size(LIST_GROUP)
fn listed(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let count = unrepresented_count();
    for (var slot = id.x; slot < count; slot += groups.x * LIST_GROUP) {
        let index = unrepresented[slot];
        let pixel = vec2u(index % view.size.x, index / view.size.x);
        let own = surfel_guide_surface(textureLoad(surfels, pixel, 0));
        let per_metre = pixels_per_metre(own.position) / MOST_OFF_PLANE;
        let own_mean = mean_of(index);
        let first = vec2u(max(vec2i(pixel) - (RADIUS - 1), vec2i(0)));
        let last = min(pixel + u32(RADIUS - 1), view.size - 1u);
        var sum = vec4f(0.0);
        for (var y = first.y; y <= last.y; y += 1u) {
            for (var x = first.x; x <= last.x; x += 1u) {
                let tap_index = y * view.size.x + x;
                let tap = irradiance[tap_index];
                if (tap.w <= 0.0) {
                    continue;
                }
                let other = surfel_guide_surface(textureLoad(surfels, vec2u(x, y), 0));
                let near = 1.0 - abs(vec2f(vec2i(vec2u(x, y)) - vec2i(pixel))) / f32(RADIUS);
                let same = similarity(own, other, per_metre) * same_light(own_mean, mean_of(tap_index));
                let weight = near.x * near.y * same;
                sum += weight * vec4f(tap.rgb, 1.0);
            }
        }
        denoised[index] = vec4f(sum.rgb / max(sum.w, 0.5), 1.0);
    }
}
