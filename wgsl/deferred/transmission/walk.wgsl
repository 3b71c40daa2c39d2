// A path through surfaces that transmit light: rays that follow the BRDF of each, until one meets a surface that
// transmits none.
//
// Each surface is also lit by a sample of the lights. Sample and ray are weighted by the power heuristic (Veach 1997,
// eq. 9.15). Solids absorb by Beer's law, exp(-sigma d). Errs blurry where punctual lights shine through sharp glass:
// their light takes a lobe of at least LEAST_ALPHA, as in `deferred/hit_light.wgsl`.
#import "deferred/hit_light.wgsl"

// Most surfaces on a path: two of each of three solids, and two reflections inside.
const MOST_SURFACES: u32 = 8u;
// Pairs of random numbers of each surface: the direction, the choices, the point of a light.
const PAIRS_PER_SURFACE: u32 = 3u;
// Pairs of the path's end follow.
const END_PAIRS: u32 = MOST_SURFACES * PAIRS_PER_SURFACE;

// Place in a low-discrepancy sequence, and its seed.
struct Numbers {
    index: u32,
    code: u32,
}

fn pair_of(n: Numbers, pair: u32) -> vec2f {
    return sobol_2d(n.index, hash2(pair, n.code));
}

// Light found on the way, and the path's end.
struct Walk {
    light: vec3f,          // W/(m2 sr)
    throughput: vec3f,
    ends: bool,            // at the surface of `hit`
    hit: Hit,
    direction: vec3f,      // in which the last ray travels, unit
    emission_share: f32,   // of the end's emission that this ray finds; light samples find the rest
}

// Returns whether light samples reach a surface from a direction: rays alone find the light inside a solid.
fn is_lit_from(s: Surface, direction: vec3f) -> bool {
    return !has_volume(s.layers) || dot(s.geometric_normal, direction) > 0.0;
}

// Returns whether emitters and the environment are sampled, too: narrow lobes leave them to rays.
fn samples_lights(brdf: Brdf) -> bool {
    return (scene.light_count > 0u) & (lobe_width(brdf) >= LEAST_ALPHA);
}

// Returns the share of a hit's light that a ray finds; `light_pdf` and `pdf`: of a light sample and the ray, 1/sr.
fn share_of_ray(light_pdf: f32, pdf: f32, sampled: bool) -> f32 {
    let ratio = light_pdf / max(pdf, 1e-30);
    return select(1.0, 1.0 / (1.0 + ratio * ratio), sampled);
}

// Returns the light of a sample of the lights that a surface scatters along the path, W/(m2 sr). `passing`: only light
// that passes the surface counts.
fn sampled_light(
    s: Surface, brdf: Brdf, passing: bool, frame: mat3x3f, w_o: vec3f, choice: f32, u: vec2f
) -> vec3f {
    // The normal's length makes the branch vary: lavapipe compiles branches on uniforms anew for each dispatch.
    if ((scene.light_count == 0u) | (dot(s.normal, s.normal) == 0.0)) {
        return vec3f(0.0);
    }
    let light = sample_light(s.position, choice, u);
    let is_punctual = light.pdf <= 0.0;
    if (light.limit <= 0.0 || !is_lit_from(s, light.direction) || !(is_punctual || samples_lights(brdf))) {
        return vec3f(0.0);
    }
    var lobes = brdf;
    if (is_punctual) {
        lobes = widened(brdf);
    }
    let w_i = light.direction * frame;
    if (passing && w_i.z >= 0.0) {
        return vec3f(0.0);
    }
    let f = evaluate_brdf(lobes, w_o, w_i);
    let ratio = select(f.w / max(light.pdf, 1e-30), 0.0, is_punctual);
    let radiance = f.rgb * light.weighted * (abs(w_i.z) / (1.0 + ratio * ratio));
    if (max3(radiance) <= 0.0) {
        return vec3f(0.0);
    }
    let start = leave_surface(s, light.direction);
    let shift = select(vec3f(0.0), start - s.position, light.limit < INFINITELY_FAR);
    // Rough walls and solids block this ray, unlike a shadow ray: the path's next surfaces find the light beyond.
    let hit = trace(Ray(start, light.to_light - shift), light.limit);
    return select(vec3f(0.0), radiance * hit.tint, hit.triangle == NONE);
}

// Follows a path through the surface `first`, which a ray in `direction` has hit after `distance`, metres.
fn walk_through(first: Surface, direction: vec3f, distance: f32, numbers: Numbers) -> Walk {
    var walk: Walk;
    walk.throughput = vec3f(1.0);
    if (has_volume(first.layers) && !first.front) {
        // The eye is in a solid.
        walk.throughput = volume_transmittance(first.layers.attenuation, distance);
    }
    walk.direction = direction;
    var s = first;
    // The technique has what the first surface reflects; it knows nothing of reflections inside a solid.
    let passing = s.front || !has_volume(s.layers);
    var absorption = vec3f(0.0);  // of the solid that the path is in, 1/m
    for (var k = 0u; k <= MOST_SURFACES; k += 1u) {
        var brdf = surface_brdf(s);
        if (k == 0u) {
            brdf.diffuse = vec3f(0.0);
        } else if (!transmits(s) || (s.flags & UNLIT) != 0u) {
            walk.ends = true;
            return walk;
        } else {
            walk.light += walk.throughput * s.emission * walk.emission_share;
        }
        if (k == MOST_SURFACES) {
            return walk;
        }
        // Light the surface, and follow its BRDF.
        let frame = frame_from_normal(s.normal);
        let passes_only = passing && k == 0u;
        let w_o = -walk.direction * frame;
        let choices = pair_of(numbers, PAIRS_PER_SURFACE * k);
        let u_light = pair_of(numbers, PAIRS_PER_SURFACE * k + 1u);
        walk.light += walk.throughput * sampled_light(s, brdf, passes_only, frame, w_o, choices.x, u_light);
        let next = sample_brdf(brdf, w_o, pair_of(numbers, PAIRS_PER_SURFACE * k + 2u), choices.y);
        walk.throughput *= next.weight;
        if (next.pdf <= 0.0 || max3(walk.throughput) <= 0.0 || (passes_only && next.w_i.z >= 0.0)) {
            return walk;
        }
        walk.direction = normalize(frame * next.w_i);
        // Both normals must agree on the side: light would be refracted without entering the solid.
        let crosses = s.front == (dot(s.geometric_normal, walk.direction) < 0.0);
        if (crosses != (next.w_i.z < 0.0)) {
            return walk;
        }
        if (has_volume(s.layers) && crosses) {
            absorption = select(vec3f(0.0), s.layers.attenuation, s.front);
        }
        let sampled = samples_lights(brdf) && is_lit_from(s, walk.direction);
        let hit = trace(Ray(leave_surface(s, walk.direction), walk.direction), FLOAT_MAX);
        walk.throughput *= hit.tint;
        if (hit.triangle == NONE) {
            let share = share_of_ray(environment_pdf(walk.direction), next.pdf, sampled);
            walk.light += walk.throughput * environment_radiance(walk.direction) * share;
            return walk;
        }
        // Absorb light on the way inside a solid: that of the surface, if the ray arrives at its back.
        s = surface_at(hit, walk.direction);
        if (has_volume(s.layers) && !s.front) {
            absorption = s.layers.attenuation;
        }
        walk.throughput *= volume_transmittance(absorption, hit.distance);
        let cosine = max(abs(dot(s.geometric_normal, walk.direction)), 1e-12);
        let light_pdf = s.emitter_pdf * hit.distance * hit.distance / cosine;
        walk.emission_share = share_of_ray(light_pdf, next.pdf, sampled);
        walk.hit = hit;
    }
    return walk;
}
