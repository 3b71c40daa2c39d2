// An estimate of the light that a surface scatters from all emitters, from few shadow rays.
//
// L = 1/K sum_k a f V / p + a' g V: K light samples of density p, and where emitters are near or the surface is glossy
// one sample of the BRDF. The power heuristic shares the light between both: a + a' = 1 at every point of an emitter
// (Veach 1997, eq. 9.15). So the light of near emitters is bounded, and mirrors reflect them.
#import "scene/trace.wgsl"
#import "scene/emission.wgsl"
#import "deferred/direct/receiver.wgsl"
#import "deferred/emitters/tree.wgsl"
#import "deferred/emitters/numbers.wgsl"

override RAYS: u32 = 4u;  // K, shadow rays of light samples, an even number

// The BRDF is sampled where its density may exceed this share of that of light samples; `tools/sweeps.py` measures other
// values.
const BRDF_FROM: f32 = 0.3;
// Emitters are near within this many radii of their leaves; `tools/sweeps.py` measures other values.
const NEAR_RADII: f32 = 2.0;

struct EmitterSample {
    to_light: vec3f,  // metres
    light: vec3f,     // a f / p
}

// A surface point.
struct Target {
    r: Receiver,
    table: EmitterTable,
    uses_brdf: bool,      // the BRDF is sampled, too
}

// Returns the weight of light samples at an emitter's point, from both densities in 1/sr.
fn share_of_light_samples(t: Target, light_pdf: f32, brdf_pdf: f32) -> f32 {
    let ratio = select(0.0, brdf_pdf, t.uses_brdf) / max(f32(RAYS) * light_pdf, 1e-37);
    return 1.0 / (1.0 + ratio * ratio);
}

// Samples a point of an emitter.
fn sample_emitter(t: Target, numbers: Numbers) -> EmitterSample {
    let r = t.r;
    let none = EmitterSample(vec3f(0.0), vec3f(0.0));
    let drawn = draw_emitter(t.table.width, r.position, r.normal, numbers.choice);
    if (drawn.probability <= 0.0) {
        return none;
    }
    let leaf = load_emitter_leaf(t.table, drawn.leaf);
    let inside = emitter_weights(leaf.cell.xy + vec2f(drawn.rest, numbers.point) * leaf.cell.zw);
    let to_light = leaf.corner + inside.x * leaf.edge1 + inside.y * leaf.edge2 - r.position;
    let squared = dot(to_light, to_light);
    let direction = normalize_or(to_light, vec3f(0.0));
    // Cosine at the light, positive on the side of edge1 x edge2.
    let cosine = -dot(normalize_or(cross(leaf.edge1, leaf.edge2), vec3f(0.0)), direction);
    let arriving = dot(r.normal, direction);
    if ((leaf.sides & select(2u, 1u, cosine > 0.0)) == 0u || cosine == 0.0 || arriving <= 0.0) {
        return none;
    }
    let f = evaluate_brdf(r.brdf, r.w_o, direction * r.frame);
    let density = drawn.probability / leaf.area * squared / abs(cosine);
    let share = share_of_light_samples(t, density, f.w);
    let emission = emission_at(leaf.triangle, leaf.radiance, turn_weights(inside, leaf.turn));
    let light = f.rgb * emission * (arriving * share / max(density, 1e-37));
    return EmitterSample(to_light, light);
}

// Returns about the largest density of the BRDF's samples.
fn peak_brdf_pdf(r: Receiver) -> f32 {
    if (!r.brdf.glossy) {
        return INV_PI;
    }
    let cos_o = max(r.w_o.z, 1e-3);
    let share = lobe_shares(r.brdf, cos_o, coat_loss(r.brdf.fit, r.brdf.alpha, cos_o)).single;
    return mix(INV_PI, ggx_pdf(lobe_width(r.brdf), 1.0, cos_o), share);
}

// Returns the radiance that a hit of the BRDF's sample adds.
fn emission_of_hit(t: Target, ray: Ray, hit: Hit, scattered: BrdfSample) -> vec3f {
    let triangle = load_triangle(hit.triangle);
    if (materials[triangle.material].emitter_pdf <= 0.0) {
        return vec3f(0.0);
    }
    let surface = surface_on(triangle, hit, ray.direction);
    let leaf = find_emitter_leaf(t.table, hit.triangle, hit.instance, hit_weights(triangle, hit));
    var light_pdf = 0.0;
    if (leaf != NONE) {
        let area = load_emitter_leaf(t.table, leaf).area;
        let cosine = max(abs(dot(surface.geometric_normal, ray.direction)), 1e-12);
        light_pdf = emitter_probability(t.table.width, t.r.position, t.r.normal, leaf) / area
            * hit.distance * hit.distance / cosine;
    }
    return scattered.weight * surface.emission * (1.0 - share_of_light_samples(t, light_pdf, scattered.pdf));
}

// Light of all emitters, W/(m2 sr).
struct Scattered {
    halves: mat2x3f,   // by the even and by the odd light samples: two estimates
    by_brdf: vec3f,    // by the BRDF's sample
}

fn sum_of(s: Scattered) -> vec3f {
    return 0.5 * (s.halves[0] + s.halves[1]) + s.by_brdf;
}

// Estimates the light of all emitters that a surface scatters to the eye. `offset`: of rays that leave it,
// metres. `index`: of the frame.
fn scattered_from_emitters(r: Receiver, offset: f32, pixel: vec2u, index: u32, seed: u32) -> Scattered {
    let table = load_emitter_table();
    // Far from emitters and on rough surfaces, light samples suffice.
    let gap = emitter_gap(table.width, r.position);
    let light_pdf = f32(RAYS) * gap * gap * table.dimmest;
    let uses_brdf = gap < NEAR_RADII * table.radius || peak_brdf_pdf(r) > BRDF_FROM * light_pdf;
    let t = Target(r, table, uses_brdf);
    var sum = Scattered(mat2x3f(), vec3f(0.0));
    for (var k = 0u; k < RAYS; k += 2u) {
        let numbers = sample_numbers(pixel, index * RAYS + k, seed);
        var rays: Rays;
        // Two light samples, and with the first two the BRDF's.
        let a = sample_emitter(t, numbers);
        let start_a = offset_origin(r.position, r.geometric_normal, offset, a.to_light);
        rays.shadow_a = Ray(start_a, a.to_light - (start_a - r.position));
        rays.limit_a = select(0.0, STOP_SHORT, max3(a.light) > 0.0);
        let b = sample_emitter(t, sample_numbers(pixel, index * RAYS + k + 1u, seed));
        let start_b = offset_origin(r.position, r.geometric_normal, offset, b.to_light);
        rays.shadow_b = Ray(start_b, b.to_light - (start_b - r.position));
        rays.limit_b = select(0.0, STOP_SHORT, max3(b.light) > 0.0);
        var scattered = BrdfSample(vec3f(0.0), vec3f(0.0), 0.0);
        if (k == 0u && uses_brdf) {
            let own = sample_numbers(pixel, index, seed);
            scattered = sample_brdf(r.brdf, r.w_o, own.brdf, own.lobe);
            let direction = normalize_or(r.frame * scattered.w_i, r.normal);
            rays.main = Ray(offset_origin(r.position, r.geometric_normal, offset, direction), direction);
            rays.limit = select(0.0, FLOAT_MAX, scattered.pdf > 0.0 && is_finite(scattered.weight));
        }
        let found = trace_all(rays);
        sum.halves[0] += select(a.light * found.tint_a, vec3f(0.0), found.occluded_a);
        sum.halves[1] += select(b.light * found.tint_b, vec3f(0.0), found.occluded_b);
        if (rays.limit > 0.0 && found.hit.triangle != NONE) {
            sum.by_brdf += found.hit.tint * emission_of_hit(t, rays.main, found.hit, scattered);
        }
    }
    sum.halves *= 2.0 / f32(RAYS);
    return sum;
}
