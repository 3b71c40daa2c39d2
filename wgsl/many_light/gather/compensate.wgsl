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
// In: G-buffer, scene, VPLs. Out: irradiance, W/m2, added at one of SPACING pixels of the grid, times SPACING. Errs
// dark after SEGMENTS, and by the part of the coats' light that the bound removes.
#import "scene/sequence.wgsl"
#import "deferred/environment/reflectance.wgsl"
#import "many_light/gather/hit_light.wgsl"
#import "many_light/gather/receiver.wgsl"
#import "shared/upsample/grid_pixel.wgsl"
#import "many_light/near_field/share.wgsl"

override SEGMENTS: u32 = 2u;  // most segments of a path; 1: y reflects direct light only

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
// Largest bound of a hit over q: bounds the brightness of a hit, errs dark beside VPLs of large areas.
const MOST_BOUND: f32 = 2.0;
const COMPENSATION_PAIR: u32 = 7u;  // first of the pairs of random numbers
const PAIRS_PER_SEGMENT: u32 = 5u;
// Invocations on a side of a block that shares a low-discrepancy sequence.
const BLOCK: u32 = 4u;

// Where a path starts: the pixel's surface, on the side that the camera sees.
struct Start {
    pixel: vec2u,     // of the grid
    at: Receiver,
    side: vec3f,      // geometric normal
    proposed: f32,    // q, m2; 0: there is nothing to light
    block: u32,       // seed of the random numbers
    index: u32,       // of them
}

// Returns the start of a path; `place`: of the invocation.
fn start_of(place: vec2u) -> Start {
    // Take one pixel in a row of SPACING: another in the next row, and in the next frame.
    let whole = whole_place(place * vec2u(SPACING, 1u)) / vec2u(SPACING, 1u);
    let pixel = vec2u(SPACING * place.x + (whole.y + sequence.index) % SPACING, place.y);
    let at = load_receiver(grid_pixel(pixel), params.near_radius);
    let block = hash2(whole.x / BLOCK, hash2(whole.y / BLOCK, params.seed));
    let index = (sequence.index * BLOCK + whole.y % BLOCK) * BLOCK + whole.x % BLOCK;
    let lit = all(pixel < grid_size()) && at.depth > 0.0;
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
        var p = path_point(s, ray.direction);
        if (HAS_LOBES) {
            // Photons carry the brightest part of lobes.
            p.most = MOST_GATHERED;
        }
        let squared = hit.distance * hit.distance;
        let vpls = vpls_at_point(p, squared, start.proposed, sobol_2d(start.index, hash2(code, 2u)));
        let most = MOST_BOUND * start.proposed;
        let removed = min(vpls.removed, most / (squared + most));
        throughput *= hit.tint * (removed * (squared + start.proposed) / start.proposed);
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
        irradiance[start.pixel.y * grid_size().x + start.pixel.x] += vec4f(light_of_path(start, segment.ray, hit), 0.0);
    }
}
