// One invocation finds the light of its class' VPLs for four pixels by few rays: each goes to a VPL drawn by what it
// would give if nothing stood between (importance resampling, Talbot et al. 2005, "Importance Resampling for Global
// Illumination").
//
// L = W / K sum_k f_k V_k / w_k, W = sum_i w_i over the VPLs of the class, f_i what VPL i gives unshadowed, w_i its
// luminance. The k-th of K rays goes to the VPL at (k + u) / K of all weight. Slots follow each other in space, and u is
// a low-discrepancy sequence over the picture and the frames, so neighbours and frames share the VPLs out among them.
// In: G-buffer, VPLs, scene. Out: irradiance, W/m2, and what coats reflect. Unbiased but for the bound of near VPLs;
// noisy where few of the VPLs that face a surface reach it.
#import "many_light/gather/common.wgsl"
#import "many_light/gather/sight.wgsl"
#import "common/random.wgsl"

override RAYS: u32 = 1u;  // K, of each pixel

// The weights of a class are summed in so many runs of words at most: only one of them is gone through again to find
// the VPL drawn. Chosen.
const RUNS: u32 = 16u;

// Multiples of 2^32 that spread points over [0, 1): of pixels by Roberts 2018, "The Unreasonable Effectiveness of
// Quasirandom Sequences" (R2), of frames by the golden ratio.
const STEP_X: u32 = 3242174889u;
const STEP_Y: u32 = 2447445414u;
const STEP_FRAME: u32 = 2654435769u;

// What a VPL gives to a pixel, unshadowed, without the factors that all VPLs share.
struct Light {
    irradiance: vec3f,
    glossy: vec3f,     // radiance
    weight: f32,
    squared: f32,      // of the distance, m2
}

fn light_of(vpl: Vpl, near: f32, at: Receiver) -> Light {
    let way = at.position - vpl.position;
    let squared = dot(way, way);
    let reach = squared + bound_of(vpl);
    let leaving = max(dot(way, vpl.normal), 0.0);
    let arriving = max(-dot(way, at.normal), 0.0);
    // Both cosines still have a length of d. Above zero, for 0 / 0 where VPL and pixel meet.
    let term = leaving * arriving / max(squared * reach, 1e-37);
    let flux = vpl.flux * term;
    let far = far_share(near, squared, at.reach);
    if (!HAS_COATS) {
        return Light(flux * far, vec3f(0.0), luminance(flux) * far, squared);
    }
    let shine = shine_of(at.brdf, at.normal, at.to_eye, -way, reach, vpl.area);
    let passed = flux * (1.0 - shine.fresnel) * far;
    let coat = flux * shine.fresnel * shine.lobe;
    // Black surfaces, too, share the light out: the blur averages irradiance.
    let weight = luminance(passed * max(at.brdf.diffuse, vec3f(0.01)) * INV_PI + coat);
    return Light(passed, coat, weight, squared);
}

// Returns the slot of a run that holds the place `wanted` in the sum of its weights.
fn draw(at: Receiver, begin: u32, class_number: u32, run: u32, wanted: f32) -> u32 {
    var sum = 0.0;
    var slot = class_number;
    let words = run_words();
    let end = min((run + 1u) * words, words_per_class(params.vpl_count));
    for (var word = run * words; word < end && sum <= wanted; word += 1u) {
        var bits = slots_of_word(params.vpl_count, class_number, word);
        if (CULLED) {
            bits = lists[begin + word];
        }
        while (bits != 0u && sum <= wanted) {
            let next = slot_of(class_number, 32u * word + firstTrailingBit(bits));
            bits &= bits - 1u;
            let weight = light_of(load_vpl(next), load_near_share(next), at).weight;
            sum += weight;
            slot = select(slot, next, weight > 0.0);
        }
    }
    return slot;
}

fn run_words() -> u32 {
    return (words_per_class(params.vpl_count) + RUNS - 1u) / RUNS;
}

@compute @workgroup_size(GROUP_X, GROUP_Y)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) thread: vec3u) {
    let place = place_of(group, thread);
    if (any(place.pixel >= view.size)) {
        return;
    }
    let at = load_four(place.pixel);
    let begin = lists_of(place);
    let class_number = place.class_number;

    // Sum up the weights of all VPLs, for the four pixels.
    let words = run_words();
    var sums: array<vec4f, RUNS>;
    var total = vec4f(0.0);
    var bounds = Bounds(vec4f(0.0), vec4f(0.0));
    for (var run = 0u; run < RUNS; run += 1u) {
        var sum = vec4f(0.0);
        let end = min((run + 1u) * words, words_per_class(params.vpl_count));
        for (var word = run * words; word < end; word += 1u) {
            var bits = slots_of_word(params.vpl_count, class_number, word);
            if (CULLED) {
                bits = lists[begin.x + word] | lists[begin.y + word] | lists[begin.z + word] | lists[begin.w + word];
            }
            while (bits != 0u) {
                let slot = slot_of(class_number, 32u * word + firstTrailingBit(bits));
                bits &= bits - 1u;
                let vpl = load_vpl(slot);
                let near = load_near_share(slot);
                let a = light_of(vpl, near, at.a);
                let b = light_of(vpl, near, at.b);
                let c = light_of(vpl, near, at.c);
                let d = light_of(vpl, near, at.d);
                let weights = vec4f(a.weight, b.weight, c.weight, d.weight);
                sum += weights;
                if (COMPENSATED) {
                    let squared = vec4f(a.squared, b.squared, c.squared, d.squared);
                    bounds = add_bound(bounds, bound_of(vpl), squared, weights);
                }
            }
        }
        sums[run] = sum;
        total += sum;
    }

    let first = place.pixel.x * STEP_X + place.pixel.y * STEP_Y + sequence.index * STEP_FRAME + hash(params.seed);
    let codes = first + vec4u(0u, 1u, 2u, 3u) * (INTERLEAVE * STEP_Y);
    let u = vec4f(codes >> vec4u(8u)) / 16777216.0;
    var colors = mat4x3f();
    var coats = mat4x3f();
    for (var k = 0u; k < RAYS; k += 1u) {
        // Find the run, then the VPL in it.
        let wanted = total * ((f32(k) + u) / f32(RAYS));
        var chosen = vec4u(0u);
        var before = vec4f(0.0);
        var sum = vec4f(0.0);
        for (var run = 0u; run < RUNS; run += 1u) {
            let inside = (sums[run] > vec4f(0.0)) & (sum <= wanted);
            chosen = select(chosen, vec4u(run), inside);
            before = select(before, sum, inside);
            sum += sums[run];
        }
        let rest = wanted - before;
        let slots = vec4u(
            draw(at.a, begin.x, class_number, chosen.x, rest.x), draw(at.b, begin.y, class_number, chosen.y, rest.y),
            draw(at.c, begin.z, class_number, chosen.z, rest.z), draw(at.d, begin.w, class_number, chosen.w, rest.w));
        let a = load_vpl(slots.x);
        let b = load_vpl(slots.y);
        let c = load_vpl(slots.z);
        let d = load_vpl(slots.w);
        let seen = vec4f(see_two(sight_of(at.a, a), sight_of(at.b, b)), see_two(sight_of(at.c, c), sight_of(at.d, d)));
        let light_a = light_of(a, load_near_share(slots.x), at.a);
        let light_b = light_of(b, load_near_share(slots.y), at.b);
        let light_c = light_of(c, load_near_share(slots.z), at.c);
        let light_d = light_of(d, load_near_share(slots.w), at.d);
        let weights = vec4f(light_a.weight, light_b.weight, light_c.weight, light_d.weight);
        let share = select(vec4f(0.0), seen * total / max(weights, vec4f(1e-37)), weights > vec4f(0.0));
        colors[0] += light_a.irradiance * share.x;
        colors[1] += light_b.irradiance * share.y;
        colors[2] += light_c.irradiance * share.z;
        colors[3] += light_d.irradiance * share.w;
        if (HAS_COATS) {
            coats[0] += light_a.glossy * share.x;
            coats[1] += light_b.glossy * share.y;
            coats[2] += light_c.glossy * share.z;
            coats[3] += light_d.glossy * share.w;
        }
    }
    let scale = f32(class_count()) * INV_PI / f32(RAYS);
    let step = vec2u(0u, INTERLEAVE);
    let means = transpose(mat2x4f(bounds.bounds, bounds.weights));
    store(place.pixel, colors[0] * scale, coats[0] * scale, means[0], at.a);
    store(place.pixel + step, colors[1] * scale, coats[1] * scale, means[1], at.b);
    store(place.pixel + 2u * step, colors[2] * scale, coats[2] * scale, means[2], at.c);
    store(place.pixel + 3u * step, colors[3] * scale, coats[3] * scale, means[3], at.d);
}
