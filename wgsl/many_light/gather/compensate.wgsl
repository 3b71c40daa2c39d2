// One invocation traces a path of short segments from one of SPACING pixels and adds the light that the bound of near
// VPLs removes (Kollig and Keller 2004, "Illumination in the Presence of Weak Singularities").
//
// E(x) = integral L(y) cos_x cos_y / d^2 V b / (d^2 + b) dA(y): the part of the geometry term that bounded VPLs lack,
// with b / (d^2 + b) averaged over the VPLs near y. The direction of a ray has the density cos / pi and its length t
// the distribution P(t > d) = q / (d^2 + q), so E = pi L(y) b (d^2 + q) / (q (d^2 + b)) for a hit, else 0; q is the
// mean bound of all VPLs times PROPOSED. L(y) is the light that y reflects, as a VPL there would: a sample of the
// lights, of a constant environment, and of one VPL, each with a shadow ray. The light that the bound removes at y
// comes from the path's next segment.
//
// In: G-buffer, scene, VPLs. Out: irradiance, W/m2, added at one of SPACING pixels, times SPACING. Errs dark after
// SEGMENTS, and by the part of the coats' light that the bound removes.
#import "scene/sequence.wgsl"
#import "scene/lights.wgsl"
#import "scene/trace.wgsl"
#import "common/coat.wgsl"
#import "deferred/environment/reflectance.wgsl"
#import "many_light/vpl/table.wgsl"
#import "many_light/gather/bound.wgsl"
#import "many_light/gather/receiver.wgsl"
#import "many_light/near_field/share.wgsl"

override SEGMENTS: u32 = 2u;  // most segments of a path; 1: y reflects direct light only
override HAS_ENVIRONMENT: bool = true;

@group(1) @binding(11) var<storage, read_write> irradiance: array<vec4f>;
@group(1) @binding(12) var<storage, read> mean_bound: array<f32>;  // of all VPLs, m2
@group(1) @binding(19) var<uniform> params: Params;

struct Params {
    vpl_count: u32,
    seed: u32,
    near_radius: f32,  // r_max of the near field, heights of the picture
}

// Pixels in a row, one of which takes a path. 320x180, corridor and a random room: 2 take 13 % of the time of a frame,
// 3 take 9 %; single frames of the courtyard have relMSE 0.044 and 0.053 under a sky, 0.038 and 0.037 under a sun.
const SPACING: u32 = 3u;
// Candidates for the VPL that lights y, drawn by their unshadowed light (Talbot et al. 2005). 128 take 5 % more time of
// a frame of 320x180 and are no less noisy.
const CANDIDATES: u32 = 32u;
// q over the mean bound of all VPLs: more is less noisy and takes more time, since more rays hit.
const PROPOSED: f32 = 2.0;
// Largest bound of a hit over q: bounds the brightness of a hit, errs dark beside VPLs of large areas.
const MOST_BOUND: f32 = 2.0;
const COMPENSATION_PAIR: u32 = 7u;  // first of the pairs of random numbers
const PAIRS_PER_SEGMENT: u32 = 5u;
// Invocations on a side of a block that shares a low-discrepancy sequence.
const BLOCK: u32 = 4u;

// A surface point that a path has hit.
struct PathPoint {
    surface: Surface,
    brdf: Brdf,
    side: vec3f,     // geometric normal on the side of the path
}

// Light that arrives at a point unless something blocks it, W/m2, and the way that a shadow ray must be clear.
struct Arrival {
    irradiance: vec3f,  // times the reflectance
    way: vec3f,
    limit: f32,         // in lengths of the way; 0: no light
}

// What the VPLs say about a point: the light of one of them there, and the share of light that their bound removes.
struct VplsAtPoint {
    arrival: Arrival,
    removed: f32,       // 0 to 1
}

// Returns the reflectance of light that arrives along `to_light`, unit.
fn reflectance_towards(p: PathPoint, to_light: vec3f) -> vec3f {
    let cosine = dot(p.surface.normal, to_light);
    let faces = cosine > 0.0 && dot(p.side, to_light) > 0.0;
    return select(vec3f(0.0), directional_reflectance(p.brdf, max(cosine, 0.0)), faces);
}

// Returns the reflectance times the cosine.
fn reflected_share(p: PathPoint, to_light: vec3f) -> vec3f {
    return reflectance_towards(p, to_light) * dot(p.surface.normal, to_light);
}

fn arrival_from_light(p: PathPoint, choice: f32, u: vec2f) -> Arrival {
    let light = sample_light(p.surface.position, choice, u);
    let arriving = light.weighted * reflected_share(p, light.direction);
    return Arrival(arriving, light.to_light, select(0.0, light.limit, max3(arriving) > 0.0));
}

// Draws a VPL in proportion to its light at a point, and averages the share that the bounds of VPLs nearby remove at a
// squared distance; if none lies on a surface like that of the point, the share of the mean bound. `reach`: q, the
// squared radius of the kernel of that mean, m2.
fn vpls_at_point(p: PathPoint, squared_distance: f32, reach: f32, u: vec2f) -> VplsAtPoint {
    var sum = 0.0;
    var color = vec3f(0.0);
    var chosen_way = vec3f(0.0);
    var random = u.y;
    var removed = 0.0;
    var weights = 0.0;
    for (var k = 0u; k < CANDIDATES; k += 1u) {
        let slot = min(u32((f32(k) + u.x) / f32(CANDIDATES) * f32(params.vpl_count)), params.vpl_count - 1u);
        let vpl = load_vpl(slot);
        let way = vpl.position - p.surface.position;
        let squared = dot(way, way);
        let bound = bound_of(vpl);
        // Bright VPLs lose more light to their bound.
        let near = reach / (squared + reach);
        let near_weight = luminance(vpl.flux) * near * near;
        let counts = select(0.0, near_weight, dot(p.side, vpl.normal) > SIMILAR_NORMALS);
        removed += counts * bound / max(squared_distance + bound, 1e-37);
        weights += counts;
        if (SEGMENTS == 1u) {
            continue;
        }
        let leaving = max(-dot(way, vpl.normal), 0.0);
        let arriving = max(dot(way, p.surface.normal), 0.0);
        let geometry = leaving * arriving / max(squared * (squared + bound), 1e-37);
        let weight = luminance(vpl.flux) * geometry;
        if (weight > 0.0) {
            // Keep this candidate with the probability weight / sum, and use the random number again.
            sum += weight;
            let share = weight / sum;
            let takes = random < share;
            random = select((random - share) / max(1.0 - share, 1e-7), random / share, takes);
            if (takes) {
                color = vpl.flux / luminance(vpl.flux);
                chosen_way = way;
            }
        }
    }
    // Reflect the light of the chosen candidate, over its probability.
    let to_vpl = normalize_or(chosen_way, p.side);
    let reflected = reflectance_towards(p, to_vpl);
    let scale = sum * INV_PI * f32(params.vpl_count) / f32(CANDIDATES);
    let chosen = Arrival(color * reflected * scale, chosen_way, select(0.0, STOP_SHORT, sum > 0.0));
    let usual = reach / PROPOSED;
    let mean = removed / max(weights, 1e-37);
    return VplsAtPoint(chosen, select(usual / max(squared_distance + usual, 1e-37), mean, weights > 0.0));
}

// Returns the ray of an arrival. Only the start is shifted off the surface; the end stays.
fn arrival_ray(s: Surface, arrival: Arrival) -> Ray {
    let start = leave_surface(s, arrival.way);
    let shift = select(vec3f(0.0), start - s.position, arrival.limit < INFINITELY_FAR);
    return Ray(start, arrival.way - shift);
}

// Returns the radiance that a point reflects diffusely, W/(m2 sr).
fn reflected_radiance(p: PathPoint, indirect: Arrival, index: u32, code: u32) -> vec3f {
    // Sample the lights.
    var direct = Arrival(vec3f(0.0), vec3f(0.0), 0.0);
    if ((scene.light_count > 0u) & (dot(p.side, p.side) > 0.0)) {
        direct = arrival_from_light(p, sobol_2d(index, hash2(code, 1u)).y, sobol_2d(index, hash2(code, 3u)));
    }
    var rays: Rays;
    rays.shadow_a = arrival_ray(p.surface, direct);
    rays.limit_a = direct.limit;
    rays.shadow_b = arrival_ray(p.surface, indirect);
    rays.limit_b = indirect.limit;
    // A constant environment is not in the table of lights: sample the cosine.
    var sky = vec3f(0.0);
    if (HAS_ENVIRONMENT && !HAS_PICTURED_ENVIRONMENT) {
        let local = sample_cosine_hemisphere(sobol_2d(index, hash2(code, 4u)));
        let way = frame_from_normal(p.surface.normal) * local;
        sky = scene.environment_color * reflected_share(p, way) * (PI / max(local.z, 1e-6));
        rays.main = Ray(leave_surface(p.surface, way), way);
        rays.limit = select(0.0, FLOAT_MAX, max3(sky) > 0.0);
    }
    let found = trace_all(rays);
    var sum = select(direct.irradiance, vec3f(0.0), found.occluded_a);
    sum += select(indirect.irradiance, vec3f(0.0), found.occluded_b);
    sum += select(vec3f(0.0), sky, found.hit.triangle == NONE);
    return sum * INV_PI;
}

// Where a path starts: the pixel's surface, on the side that the camera sees.
struct Start {
    pixel: vec2u,
    at: Receiver,
    side: vec3f,      // geometric normal
    proposed: f32,    // q, m2; 0: there is nothing to light
    block: u32,       // seed of the random numbers
    index: u32,       // of them
}

// Returns the start of a path; `place`: of the invocation.
fn start_of(place: vec2u) -> Start {
    // Take one pixel in a row of SPACING: another in the next row, and in the next frame.
    let pixel = vec2u(SPACING * place.x + (place.y + sequence.index) % SPACING, place.y);
    let at = load_receiver(pixel, params.near_radius);
    let block = hash2(place.x / BLOCK, hash2(place.y / BLOCK, params.seed));
    let index = (sequence.index * BLOCK + place.y % BLOCK) * BLOCK + place.x % BLOCK;
    let lit = all(pixel < view.size) && at.depth > 0.0;
    let faces_eye = dot(at.geometric_normal, at.to_eye) > 0.0;
    let side = select(-at.geometric_normal, at.geometric_normal, faces_eye);
    return Start(pixel, at, side, select(0.0, PROPOSED * mean_bound[0], lit), block, index);
}

fn code_of(block: u32, segment: u32) -> u32 {
    return hash2(COMPENSATION_PAIR + segment * PAIRS_PER_SEGMENT, block);
}

// A ray of unit direction and its length, metres; 0: no ray.
struct Segment {
    ray: Ray,
    reach: f32,
}

// Draws a ray's direction by the cosine and its length by the part of the light that the bound removes.
fn draw_segment(
    origin: vec3f, offset: f32, side: vec3f, normal: vec3f, proposed: f32, index: u32, code: u32
) -> Segment {
    let direction = frame_from_normal(normal) * sample_cosine_hemisphere(sobol_2d(index, hash2(code, 0u)));
    let u = sobol_2d(index, hash2(code, 1u)).x;
    let reach = sqrt(proposed * (1.0 / max(u, 1e-7) - 1.0));
    let start = offset_origin(origin, side, offset, direction);
    return Segment(Ray(start, direction), select(0.0, reach, dot(side, direction) > 0.0));
}

fn first_segment(start: Start) -> Segment {
    let at = start.at;
    let offset = ray_offset(at.geometric_normal, pixel_terms(at.position));
    return draw_segment(
        at.position, offset, start.side, at.normal, start.proposed, start.index, code_of(start.block, 0u));
}

// Returns the irradiance that a path finds, W/m2, from the first hit on.
fn light_of_path(start: Start, first_ray: Ray, first_hit: Hit) -> vec3f {
    var ray = first_ray;
    var hit = first_hit;
    var throughput = vec3f(1.0);
    var sum = vec3f(0.0);
    for (var k = 0u; k < SEGMENTS; k += 1u) {
        let s = surface_at(hit, ray.direction);
        if ((s.flags & UNLIT) != 0u) {
            break;
        }
        // Weight the hit by the light that the bound removes, over the probability of the ray's length.
        let code = code_of(start.block, k);
        let p = PathPoint(s, surface_brdf(s), select(-s.geometric_normal, s.geometric_normal, s.front));
        let squared = hit.distance * hit.distance;
        let vpls = vpls_at_point(p, squared, start.proposed, sobol_2d(start.index, hash2(code, 2u)));
        let most = MOST_BOUND * start.proposed;
        let removed = min(vpls.removed, most / (squared + most));
        throughput *= removed * (squared + start.proposed) / start.proposed;
        if (k == 0u) {
            throughput *= transmitted_from(start.at.brdf, start.at.normal, ray.direction, start.at.to_eye);
            if (NEAR_FIELD) {
                throughput *= far_field_share(near_share_of(s.position, p.side), squared, start.at.near_radius);
            }
        }
        // Add the light that the hit reflects.
        sum += throughput * reflected_radiance(p, vpls.arrival, start.index, code);
        // Go on with the light that the bound removes there.
        throughput *= directional_reflectance(p.brdf, max(-dot(s.normal, ray.direction), 0.0));
        let next = draw_segment(
            s.position, s.offset, p.side, s.normal, start.proposed, start.index, code_of(start.block, k + 1u));
        if (k + 1u == SEGMENTS || next.reach <= 0.0) {
            break;
        }
        ray = next.ray;
        hit = trace(ray, next.reach);
        if (hit.triangle == NONE) {
            break;
        }
    }
    return sum * (PI * f32(SPACING));
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let start = start_of(id.xy);
    if (start.proposed <= 0.0) {
        return;
    }
    let segment = first_segment(start);
    let hit = trace(segment.ray, segment.reach);
    if (hit.triangle != NONE) {
        irradiance[start.pixel.y * view.size.x + start.pixel.x] += vec4f(light_of_path(start, segment.ray, hit), 0.0);
    }
}
