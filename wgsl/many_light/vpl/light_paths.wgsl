// One invocation traces a light path and stores a candidate for a virtual point light at each vertex (Keller 1997,
// "Instant Radiosity"): flux = emitted flux / density * product of the reflectances, W.
//
// The first `sky_paths` paths carry the environment's light. They start at one of the sky points, with a direction from
// which light arrives, so none misses the scene. All others start at a light. Their first vertex is black for point,
// spot and directional lights, because the reflective shadow maps already hold it. Paths end by Russian roulette and
// after `bounces`. The last candidate of a path stands for all vertices from there on: it is one of them, drawn by its
// flux, over its probability. In: scene, surface points. Out: candidates, by vertex, then by path. Unbiased, except for
// the bound on shading normals (`reflect.wgsl`).
#import "scene/sequence.wgsl"
#import "scene/lights.wgsl"
#import "scene/trace.wgsl"
#import "many_light/vpl/reflect.wgsl"
#import "many_light/vpl/lobe.wgsl"
#import "many_light/points/table.wgsl"

@group(1) @binding(12) var<storage, read_write> light_paths: array<vec4u>;
@group(1) @binding(19) var<uniform> params: Params;

struct Params {
    paths: u32,
    sky_paths: u32,
    bounces: u32,    // most vertices of a path
    seed: u32,
}

// Pairs of random numbers.
const CHOICE_PAIR: u32 = 0u;
const POINT_PAIR: u32 = 1u;
const DIRECTION_PAIR: u32 = 2u;
const FIRST_BOUNCE_PAIR: u32 = 3u;
// Highest survival of Russian roulette: below 1, so that paths end where nothing absorbs light.
const MAX_SURVIVAL: f32 = 0.95;

fn store(path: u32, vertex: u32, v: Vpl) {
    var stored = v;
    stored.last = vertex + 1u >= params.bounces;
    let packed = pack_vpl(stored);
    let first = vpl_words() * (vertex * params.paths + path);
    light_paths[first] = packed.place;
    light_paths[first + 1u] = packed.light;
    if (HAS_LOBES) {
        light_paths[first + 2u] = packed.arriving;
        light_paths[first + 3u] = packed.lobe;
    }
}

// Returns the surface at a point, seen along `direction`.
fn surface_of_point(point: SurfacePoint, direction: vec3f) -> Surface {
    let t = load_triangle(point.triangle);
    var position = point.position;
    if (HAS_INSTANCES && t.instance == NONE) {
        position = instances[point.instance].local_from_world * vec4f(position, 1.0);
    }
    // Scaling keeps the products of tiny or huge edges in range.
    let scale = 1.0 / max(max3(abs(t.edge1)), max3(abs(t.edge2)));
    let edge1 = t.edge1 * scale;
    let edge2 = t.edge2 * scale;
    let inside = (position - t.anchor) * scale;
    let normal = cross(edge1, edge2);
    let from_anchor = vec2f(dot(cross(inside, edge2), normal), dot(cross(edge1, inside), normal))
        / max(dot(normal, normal), 1e-37);
    let anchor = anchor_weights(t);
    return surface_on(
        t, Hit(0.0, point.triangle, point.instance, clamp(from_anchor, -anchor, 1.0 - anchor), UNTINTED), direction);
}

// Returns the environment's light that a side of a surface point reflects. The direction is drawn by the environment's
// picture or by the cosine, each with probability 1/2, and divided by the density of both (one-sample multiple
// importance sampling).
fn sky_vertex(point: SurfacePoint, area: f32, u: vec2f, choice: vec2f) -> Vpl {
    // Choose a side and a direction.
    let normal = select(point.normal, -point.normal, choice.x < 0.5);
    let frame = frame_from_normal(normal);
    var direction = frame * sample_cosine_hemisphere(u);
    var picture_share = 0.0;
    if (HAS_PICTURED_ENVIRONMENT) {
        picture_share = 0.5;
        if (choice.y < picture_share) {
            direction = sample_environment(u).xyz;
        }
    }
    let cosine = dot(normal, direction);
    let density = mix(cosine * INV_PI, environment_pdf(direction) / max(scene.environment_pdf, 1e-9), picture_share);
    var v = Vpl(point.position, normal, vec3f(0.0), area, no_lobe(), false);
    let radiance = environment_radiance(direction);
    if (cosine <= 0.0 || density <= 0.0 || max3(radiance) <= 0.0) {
        return v;
    }
    // Test whether the environment is visible.
    let start = point.position + normal * ray_offset(normal, surface_terms(point.position));
    let hit = trace(Ray(start, direction), FLOAT_MAX);
    if (hit.triangle == NONE) {
        // Divide by the probability of the side, 1/2.
        let inverse_density = hit.tint * (2.0 * area * cosine / density);
        v.flux = point.albedo * radiance * inverse_density;
        if (HAS_COATS) {
            v = reflect_flux(surface_of_point(point, -direction), -direction, radiance * inverse_density, area, 0.0);
        }
    }
    return v;
}

// Returns the first vertex of a path that starts at a light. `count`: number of such paths.
fn light_vertex(light: Light, count: f32, choice: f32, u_point: vec2f, u_direction: vec2f) -> Vpl {
    let sent = sample_ray_of(light, choice, u_point, u_direction);
    let hit = trace(sent.ray, FLOAT_MAX);
    if (hit.triangle == NONE || max3(sent.flux) <= 0.0) {
        return Vpl(vec3f(0.0), vec3f(0.0, 0.0, 1.0), vec3f(0.0), 0.0, no_lobe(), false);
    }
    // The area is the inverse density of such rays on the surface, of all cells of a textured triangle together;
    // textures are averaged over it.
    let falloff = select(1.0 / (hit.distance * hit.distance), 1.0, sent.parallel);
    let density = max(count * light.of_triangle * sent.ray_density * falloff, 1e-30);
    let s = surface_of_cone(hit, sent.ray.direction, inverseSqrt(density));
    let cosine = max(abs(dot(s.geometric_normal, sent.ray.direction)), 1e-6);
    let area = 1.0 / max(density * cosine, 1e-30);
    let nearness = select(1.0 / hit.distance, 0.0, sent.parallel);
    return reflect_flux(s, sent.ray.direction, sent.flux * hit.tint / count, area, nearness);
}

// The first vertex of a path: for the path's continuation, and as a candidate.
struct FirstVertex {
    v: Vpl,
    candidate: Vpl,
}

// Returns the first vertex of a path; `index`: of its random numbers.
fn first_vertex(path: u32, index: u32) -> FirstVertex {
    let choices = sobol_2d(index, hash2(CHOICE_PAIR, params.seed));
    let u_point = sobol_2d(index, hash2(POINT_PAIR, params.seed));
    let u_direction = sobol_2d(index, hash2(DIRECTION_PAIR, params.seed));
    if (path < params.sky_paths) {
        let point = load_point(path);
        let area = select(PI * point.radius * point.radius, 0.0, point.open);
        let v = sky_vertex(point, area, u_direction, vec2f(choices.y, u_point.x));
        return FirstVertex(v, v);
    }
    // These numbers pick all lights but the environment, which must be the last of the table. The Python module
    // `many_light/update.py` checks it.
    let light = pick_light(choices.x * (1.0 - scene.environment_pdf));
    let count = f32(params.paths - params.sky_paths) / (1.0 - scene.environment_pdf);
    let v = light_vertex(light, count, choices.y, u_point, u_direction);
    var candidate = v;
    if (light.kind <= KIND_SUN) {
        candidate = scale_vpl(v, 0.0);
    }
    return FirstVertex(v, candidate);
}

// Draws the direction in which a path leaves a vertex: by the cosine, or by a coat's lobe; `choice` in [0, 1) picks
// one by its flux.
fn send_on(v: Vpl, choice: f32, u: vec2f) -> Sent {
    var diffuse = 1.0;  // probability
    if (HAS_LOBES && v.lobe.roughness > 0.0) {
        diffuse = luminance(v.flux) / max(luminance(total_flux(v)), 1e-37);
        if (choice >= diffuse) {
            let sent = send_by_lobe(v, u);
            return Sent(sent.direction, sent.flux / (1.0 - diffuse));
        }
    }
    let direction = frame_from_normal(v.normal) * sample_cosine_hemisphere(u);
    return Sent(direction, v.flux / max(diffuse, 1e-6));
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let path = id.x;
    if (path >= params.paths) {
        return;
    }
    let index = path + sequence.index * params.paths;
    let vertices = arrayLength(&light_paths) / (vpl_words() * params.paths);  // candidates of a path
    let last = vertices - 1u;

    let first = first_vertex(path, index);
    var v = first.v;
    var kept = v;
    store(path, 0u, first.candidate);

    // Follow the path. The density of later vertices is not known: each represents an equal part of the sphere around
    // the scene, an upper bound of the area of convex scenes.
    let later_area = 4.0 * PI * scene.radius * scene.radius / f32(params.paths);
    var flux = vec3f(0.0);  // arriving at v; 0 for the first vertex
    var vertex = 1u;
    var last_sum = 0.0;  // luminance of the flux of all vertices that the last candidate stands for
    while (vertex < params.bounces) {
        let brightest = max3(total_flux(v));
        if (brightest <= 0.0) {
            break;
        }
        // Survive with the probability that light is reflected.
        let pair = FIRST_BOUNCE_PAIR + 2u * vertex;
        let random = sobol_2d(index, hash2(pair, params.seed));
        let survival = select(min(brightest / max(max3(flux), 1e-37), MAX_SURVIVAL), MAX_SURVIVAL, max3(flux) <= 0.0);
        if (random.x >= survival) {
            break;
        }
        // Trace the next segment.
        let sent = send_on(v, random.x / survival, sobol_2d(index, hash2(pair + 1u, params.seed)));
        flux = sent.flux / survival;
        let start = v.position + v.normal * ray_offset(v.normal, surface_terms(v.position));
        let ray = Ray(start, sent.direction);
        v = scale_vpl(v, 0.0);
        if (max3(flux) <= 0.0) {
            break;
        }
        let hit = trace(ray, FLOAT_MAX);
        if (hit.triangle == NONE) {
            break;
        }
        flux *= hit.tint;
        v = reflect_flux(surface_at(hit, ray.direction), ray.direction, flux, later_area, 1.0 / hit.distance);
        if (vertex < last) {
            store(path, vertex, v);
        } else if (max3(total_flux(v)) > 0.0) {
            // Replace the last candidate in proportion to the flux.
            let weight = luminance(total_flux(v));
            last_sum += weight;
            if (random.y * last_sum < weight) {
                kept = v;
            }
        }
        vertex += 1u;
    }
    if (last_sum > 0.0) {
        let share = last_sum / luminance(total_flux(kept));
        store(path, last, scale_vpl(kept, share));
    }
    // Leave the other candidates black.
    v = scale_vpl(v, 0.0);
    vertex = select(vertex, vertices, last_sum > 0.0);
    for (; vertex < vertices; vertex += 1u) {
        store(path, vertex, v);
    }
}
