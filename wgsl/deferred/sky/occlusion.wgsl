// One invocation estimates the environment's light at a pixel's surface with few rays, with and without occlusion. Their
// ratio is the unoccluded share: of irradiance, which the base reflects, or with COAT of what the coat reflects. Under a
// picture, a coat takes the occluded light itself.
//
// Candidate directions are sampled by the cosine, or by the coat's lobe, and, under a map, also by the map (balance
// heuristic, Veach and Guibas 1995). Each ray takes one candidate in proportion to its light (importance resampling,
// Talbot et al. 2005): E = W / K sum_k f_k V_k / w_k, f = L cos / density, w = luminance(f), W the mean of w over the
// candidates; with COAT, f = f_r L cos / density over the coat's tint (constant environment: over its unoccluded light),
// so that all pixels count alike in the blur. The pixels of an n x n square share a stratified set of random numbers and
// rotate through it from frame to frame; the following blur averages the estimates over such squares before it divides.
// In: G-buffer, scene. Out: light with occlusion (irradiance, W/m2; of a constant environment relative to the unoccluded
// light; of a coat under a picture over its tint, W/(m2 sr)), and the depth of `shared/denoise/plane.wgsl`, 0 where there is
// nothing to light; light without occlusion where a ratio follows; normals. Ratios have no noise where nothing or
// everything is occluded; of few samples they are consistent, biased either way by O(1 / rays).
#import "scene/sequence.wgsl"
#import "scene/lights.wgsl"
#import "scene/trace.wgsl"
#import "shared/gbuffer/visible_surface.wgsl"
#import "shared/gbuffer/read.wgsl"
#import "shared/gbuffer/tiles.wgsl"
#import "shared/denoise/plane.wgsl"
#import "common/interleave.wgsl"
#import "deferred/environment/ambient.wgsl"
#import "common/coat.wgsl"

override COAT: bool = false;  // the light that the coat reflects

@group(1) @binding(11) var<storage, read_write> arriving: array<vec4f>;
@group(1) @binding(12) var<storage, read_write> normals: array<u32>;
@group(1) @binding(13) var<storage, read_write> sent: array<vec4f>;
@group(1) @binding(19) var<uniform> params: Params;

struct Params {
    seed: u32,
    rays: u32,  // per pixel
}

// Pairs of the sequence; the coat has further ones.
const CHOICE_PAIR: u32 = 0u;
const OWN_PAIR: u32 = 1u;
const MAP_PAIR: u32 = 2u;
const LOBE_PAIR: u32 = 3u;
const COAT_PAIRS: u32 = 4u;

// Candidates per ray from each density: the surface's own and the map. tools/README.md, "Constants".
const CANDIDATES: u32 = 2u;

struct SkySample {
    direction: vec3f,
    light: vec3f,      // f W / w
}

// What receives the light.
struct Target {
    normal: vec3f,
    frame: mat3x3f,
    coat: Brdf,      // without the base
    w_o: vec3f,      // in the frame
    inverse: vec3f,  // 1 / the coat's unoccluded light
}

fn target_of(brdf: Brdf, normal: vec3f, to_eye: vec3f) -> Target {
    let frame = frame_from_normal(normal);
    var inverse = vec3f(0.0);
    if (COAT) {
        var reference = ambient_parts(brdf, normal, to_eye).coat;
        if (HAS_PICTURED_ENVIRONMENT) {
            reference = coat_tint(brdf, normal, to_eye);
        }
        inverse = 1.0 / max(reference, vec3f(1e-37));
    }
    return Target(normal, frame, coat_of(brdf), to_eye * frame, inverse);
}

fn random_pair(number: u32, pair: u32) -> vec2f {
    return sobol_2d(number, hash2(select(pair, pair + COAT_PAIRS, COAT), params.seed));
}

// Draws a direction of the world by the surface's own density: the cosine or the coat's lobe.
fn draw_direction(to: Target, number: u32) -> vec3f {
    let u = random_pair(number, OWN_PAIR);
    if (COAT) {
        return to.frame * sample_brdf(to.coat, to.w_o, u, random_pair(number, LOBE_PAIR).x).w_i;
    }
    return to.frame * sample_cosine_hemisphere(u);
}

// Returns f of a direction, given its density by the map.
fn incident(to: Target, direction: vec3f, by_map: f32) -> vec3f {
    let cosine = max(dot(to.normal, direction), 0.0);
    var share = vec3f(1.0);
    var density = cosine * INV_PI;
    if (COAT) {
        let reflected = evaluate_brdf(to.coat, to.w_o, direction * to.frame);
        share = reflected.rgb;
        density = reflected.w;
    }
    if (HAS_PICTURED_ENVIRONMENT) {
        density = 0.5 * (density + by_map);
    }
    let light = environment_radiance(direction) * (cosine / max(density, 1e-20));
    if (COAT) {
        return light * share * to.inverse;
    }
    return light;
}

// Returns one of the candidates, resampled by its light; `number`: of the ray in its sequence.
fn resample(to: Target, number: u32) -> SkySample {
    if (!HAS_PICTURED_ENVIRONMENT) {
        let direction = draw_direction(to, number);
        if (COAT) {
            return SkySample(direction, incident(to, direction, 0.0));
        }
        return SkySample(direction, vec3f(1.0));
    }
    // Replace the kept candidate with the probability of the new one's share in the sum so far (reservoir sampling).
    var kept = SkySample(to.normal, vec3f(0.0));
    var kept_weight = 0.0;
    var sum = 0.0;
    var choice = random_pair(number, CHOICE_PAIR).x;
    for (var k = 0u; k < 2u * CANDIDATES; k += 1u) {
        var direction: vec3f;
        var by_map: f32;
        if (k < CANDIDATES) {
            direction = draw_direction(to, number * CANDIDATES + k);
            by_map = environment_pdf(direction) / max(scene.environment_pdf, 1e-9);
        } else {
            let sampled = sample_environment(random_pair(number * CANDIDATES + k - CANDIDATES, MAP_PAIR));
            direction = sampled.xyz;
            by_map = sampled.w;
        }
        let light = incident(to, direction, by_map);
        let weight = luminance(light);
        sum += weight;
        let share = weight / max(sum, 1e-37);
        let takes = choice < share;
        choice = select((choice - share) / max(1.0 - share, 1e-7), choice / max(share, 1e-37), takes);
        if (takes) {
            kept = SkySample(direction, light);
            kept_weight = weight;
        }
    }
    kept.light *= sum / (f32(2u * CANDIDATES) * max(kept_weight, 1e-37));
    return kept;
}

@compute @workgroup_size(8, 8)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) thread: vec3u) {
    let pixel = pixel_of_tile(group, thread, view.size);
    if (any(pixel >= view.size)) {
        return;
    }
    let index = pixel.y * view.size.x + pixel.x;
    let seen = load_visibility(pixel);
    let surface = load_surface(pixel);
    if (seen.x == NONE || (surface.flags & GBUFFER_UNLIT) != 0u) {
        return;
    }
    let brdf = gbuffer_brdf(surface);
    if (COAT && !brdf.glossy) {
        return;
    }
    let ray = pixel_ray(pixel);
    let distance_seen = load_distance(pixel);
    let position = ray.origin + ray.direction * distance_seen;
    let offset = ray_offset(surface.geometric_normal, pixel_terms(position));
    // Always `params.rays`, written so that it varies: lavapipe compiles loops up to a uniform anew for each dispatch.
    let rays = select(0u, params.rays, distance_seen > 0.0);
    let to = target_of(brdf, surface.normal, -ray.direction);
    let first = (sequence.index * class_count() + class_of(whole_pixel(pixel), sequence.index)) * rays;
    var visible = vec3f(0.0);
    var unoccluded = vec3f(0.0);
    for (var k = 0u; k < rays; k += 1u) {
        let picked = resample(to, first + k);
        unoccluded += picked.light;
        if (max3(picked.light) > 0.0) {
            // As in the path tracer, directions below a triangle with a tilted normal leave it on the other side.
            let start = offset_origin(position, surface.geometric_normal, offset, picked.direction);
            let way = Ray(start, picked.direction);
            let found = trace_shadow(way, FLOAT_MAX);
            visible += select(picked.light * found.tint_a, vec3f(0.0), found.occluded_a);
        }
    }
    arriving[index] = vec4f(visible / f32(rays), plane_depth(ray, distance_seen));
    if (HAS_PICTURED_ENVIRONMENT != COAT) {
        sent[index] = vec4f(unoccluded / f32(rays), 1.0);
    }
    normals[index] = pack_view_normal(surface.normal);
}
