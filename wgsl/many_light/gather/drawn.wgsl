// A thread's gathering for its four pixels with few shadow rays: each ray goes to a VPL drawn by its unshadowed light
// (Talbot et al. 2005, "Importance Resampling for Global Illumination").
//
// L = W / K sum_k f_k V_k / w_k, W = sum_i w_i over the VPLs i of the class: f_i is the light of VPL i unshadowed, w_i
// its luminance. Ray k of K goes to the VPL at (k + u) / K of the cumulative weight. Consecutive slots are close in
// space, and u is a low-discrepancy sequence over pixels and frames, so neighbours and frames draw different VPLs.
//
// Unbiased but for the bound of near VPLs (dark in corners); noisy where few of the VPLs that face a surface are visible.
#import "many_light/gather/common.wgsl"
#import "many_light/gather/shadow_rays.wgsl"
#import "common/random.wgsl"

// Number of runs of words whose weights are summed. Drawing a VPL reads one run: more runs are shorter, but take
// registers. tools/README.md, "Constants".
const RUNS: u32 = 16u;

// Multiples of 2^32 that spread points over [0, 1): of pixels by Roberts 2018, "The Unreasonable Effectiveness of
// Quasirandom Sequences" (R2), of frames by the golden ratio.
const STEP_X: u32 = 3242174889u;
const STEP_Y: u32 = 2447445414u;
const STEP_FRAME: u32 = 2654435769u;

// The unshadowed light of a VPL at a receiver, without the factors that all VPLs share.
struct VplLight {
    irradiance: vec3f,
    glossy: vec3f,     // the coat's radiance
    weight: f32,       // its luminance
}

// Returns the light of a VPL; `near` is the share that the near field finds at distance 0.
fn light_of(vpl: Vpl, near: f32, at: Receiver) -> VplLight {
    // Compute the bounded geometry term. Both cosines are times d; the denominator stays above 0 where VPL and pixel
    // meet.
    let way = at.position - vpl.position;
    let squared = dot(way, way);
    let reach = squared + bound_of(vpl);
    let leaving = max(dot(way, vpl.normal), 0.0);
    let arriving = max(-dot(way, at.normal), 0.0);
    let term = leaving * arriving / max(squared * reach, 1e-37);
    let flux = flux_towards(vpl, way) * term;
    let far = far_field_share(near, squared, at.near_radius);
    if (!HAS_COATS) {
        return VplLight(flux * far, vec3f(0.0), luminance(flux) * far);
    }
    // Split the light between the coat and the base.
    let shine = shine_at(at, vpl, reach);
    let passed = flux * (shine.transmitted * far);
    let coat = flux * shine.coat;
    // Black surfaces, too, need irradiance, because the blur averages it: their reflectance counts as 1 %.
    let weight = luminance(passed * max(at.brdf.diffuse, vec3f(0.01)) * INV_PI + coat);
    return VplLight(passed, coat, weight);
}

fn words_per_run() -> u32 {
    return (words_per_class(params.vpl_count) + RUNS - 1u) / RUNS;
}

// Returns the slot of the VPL at `wanted` in the cumulative weight of a run.
fn draw_vpl(at: Receiver, begin: u32, class_number: u32, run: u32, wanted: f32) -> u32 {
    var sum = 0.0;
    var slot = class_number;
    let words = words_per_run();
    let end = min((run + 1u) * words, words_per_class(params.vpl_count));
    for (var word = run * words; word < end && sum <= wanted; word += 1u) {
        var bits = slots_of_word(params.vpl_count, class_number, word);
        if (CULLED) {
            bits = lists[begin + word];
        }
        while (bits != 0u && sum <= wanted) {
            let next = slot_of(class_number, 32u * word + firstTrailingBit(bits));
            bits &= bits - 1u;
            let weight = light_of(load_vpl_with_lobe(next), load_near_share(next), at).weight;
            sum += weight;
            slot = select(slot, next, weight > 0.0);
        }
    }
    return slot;
}

// Sums the weights of all VPLs of the class, for the four pixels and for each run.
fn sum_weights(at: Receivers, begin: vec4u, class_number: u32, runs: ptr<function, array<vec4f, RUNS>>) {
    let words = words_per_run();
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
                let vpl = load_vpl_with_lobe(slot);
                let near = load_near_share(slot);
                let a = light_of(vpl, near, at.a);
                let b = light_of(vpl, near, at.b);
                let c = light_of(vpl, near, at.c);
                let d = light_of(vpl, near, at.d);
                sum += vec4f(a.weight, b.weight, c.weight, d.weight);
            }
        }
        (*runs)[run] = sum;
    }
}

// The run that holds the wanted cumulative weight of each of four pixels, and the weight before the run.
struct RunPlaces {
    run: vec4u,
    before: vec4f,
}

fn find_runs(wanted: vec4f, runs: ptr<function, array<vec4f, RUNS>>) -> RunPlaces {
    var found = RunPlaces(vec4u(0u), vec4f(0.0));
    var sum = vec4f(0.0);
    for (var run = 0u; run < RUNS; run += 1u) {
        let inside = ((*runs)[run] > vec4f(0.0)) & (sum <= wanted);
        found.run = select(found.run, vec4u(run), inside);
        found.before = select(found.before, sum, inside);
        sum += (*runs)[run];
    }
    return found;
}

// Returns four numbers in [0, 1) for the pixels of a thread.
fn random_numbers(pixel: vec2u) -> vec4f {
    let whole = whole_place(pixel);
    let first = whole.x * STEP_X + whole.y * STEP_Y + sequence.index * STEP_FRAME + hash(params.seed);
    let codes = first + vec4u(0u, 1u, 2u, 3u) * (INTERLEAVE * STEP_Y);
    return vec4f(codes >> vec4u(8u)) / 16777216.0;
}

// The light that `rays` rays of each of the four pixels find, and the unshadowed light of the class, without the factors
// that all VPLs share.
struct Drawn {
    colors: mat4x3f,  // irradiance
    coats: mat4x3f,   // the coats' radiance
    total: vec4f,     // W
}

fn gather_drawn(place: Place, at: Receivers, rays: u32) -> Drawn {
    let begin = lists_of(place);
    let class_number = place.class_number;
    var runs: array<vec4f, RUNS>;
    sum_weights(at, begin, class_number, &runs);
    var total = vec4f(0.0);
    for (var run = 0u; run < RUNS; run += 1u) {
        total += runs[run];
    }
    let u = random_numbers(place.pixel);
    var colors = mat4x3f();
    var coats = mat4x3f();
    for (var k = 0u; k < rays; k += 1u) {
        // Find the run of each pixel, then the VPL in it.
        let wanted = total * ((f32(k) + u) / f32(rays));
        let places = find_runs(wanted, &runs);
        let left = wanted - places.before;
        let slots = vec4u(
            draw_vpl(at.a, begin.x, class_number, places.run.x, left.x),
            draw_vpl(at.b, begin.y, class_number, places.run.y, left.y),
            draw_vpl(at.c, begin.z, class_number, places.run.z, left.z),
            draw_vpl(at.d, begin.w, class_number, places.run.w, left.w));
        // Trace the shadow rays.
        let a = load_vpl_with_lobe(slots.x);
        let b = load_vpl_with_lobe(slots.y);
        let c = load_vpl_with_lobe(slots.z);
        let d = load_vpl_with_lobe(slots.w);
        let ab = trace_shadow_rays(shadow_ray(at.a, a), shadow_ray(at.b, b));
        let cd = trace_shadow_rays(shadow_ray(at.c, c), shadow_ray(at.d, d));
        // Add the light of the VPLs over their probabilities.
        let light_a = light_of(a, load_near_share(slots.x), at.a);
        let light_b = light_of(b, load_near_share(slots.y), at.b);
        let light_c = light_of(c, load_near_share(slots.z), at.c);
        let light_d = light_of(d, load_near_share(slots.w), at.d);
        let drawn = vec4f(light_a.weight, light_b.weight, light_c.weight, light_d.weight);
        let inverse = total / max(drawn, vec4f(1e-37));
        let share = select(vec4f(0.0), inverse, drawn > vec4f(0.0));
        colors[0] += light_a.irradiance * (share.x * ab.a);
        colors[1] += light_b.irradiance * (share.y * ab.b);
        colors[2] += light_c.irradiance * (share.z * cd.a);
        colors[3] += light_d.irradiance * (share.w * cd.b);
        if (HAS_COATS) {
            coats[0] += light_a.glossy * (share.x * ab.a);
            coats[1] += light_b.glossy * (share.y * ab.b);
            coats[2] += light_c.glossy * (share.z * cd.a);
            coats[3] += light_d.glossy * (share.w * cd.b);
        }
    }
    let share = 1.0 / f32(rays);
    return Drawn(colors * share, coats * share, total);
}

// Returns the factor of all VPLs' light. Each class has 1 / n^2 of the VPLs.
fn light_factor() -> f32 {
    return f32(class_count()) * INV_PI;
}
