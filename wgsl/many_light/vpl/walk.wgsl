// One invocation sends light along a path and leaves a candidate for a virtual point light at each of its vertices
// (Keller 1997, "Instant Radiosity"): flux = emitted flux over its density * the reflectances on the way, W.
//
// The first `sky_paths` paths begin where the environment's light arrives: at a point on a surface, against the direction
// of light, so that none is lost outside. All others leave a light; of point, spot and sun the reflective shadow maps
// hold the first vertex already, which is left black here. Paths end by Russian roulette.
#import "scene/sequence.wgsl"
#import "scene/lights.wgsl"
#import "scene/trace.wgsl"
#import "many_light/vpl/reflect.wgsl"
#import "many_light/points/table.wgsl"

@group(1) @binding(12) var<storage, read_write> walk: array<vec4u>;  // candidates, by vertex, then by path
@group(1) @binding(19) var<uniform> params: Params;

struct Params {
    paths: u32,
    sky_paths: u32,
    seed: u32,
}

const CHOICE_PAIR: u32 = 0u;
const POINT_PAIR: u32 = 1u;
const DIRECTION_PAIR: u32 = 2u;
const FIRST_BOUNCE_PAIR: u32 = 3u;
// Never certain to go on.
const MAX_SURVIVAL: f32 = 0.95;

fn store(path: u32, vertex: u32, v: Vpl) {
    let slot = vertex * params.paths + path;
    walk[2u * slot] = pack_vpl_place(v);
    walk[2u * slot + 1u] = pack_vpl_light(v);
}

// What the environment gives to a point, scattered once: a direction is drawn half by the picture, half by the cosine.
fn sky_vertex(point: SurfacePoint, share: f32, u: vec2f, choice: vec2f) -> Vpl {
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
    var v = Vpl(point.position, normal, vec3f(0.0), share);
    let radiance = environment_radiance(direction);
    if (cosine <= 0.0 || density <= 0.0 || max3(radiance) <= 0.0) {
        return v;
    }
    let start = point.position + normal * ray_offset(scene_extent());
    if (trace(Ray(start, direction), FLOAT_MAX).triangle == NONE) {
        // Both sides of the surface share the points.
        v.flux = point.albedo * radiance * (2.0 * share * cosine / density);
    }
    return v;
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let path = id.x;
    if (path >= params.paths) {
        return;
    }
    let index = path + sequence.index * params.paths;
    let choices = sobol_2d(index, hash2(CHOICE_PAIR, params.seed));
    let u_point = sobol_2d(index, hash2(POINT_PAIR, params.seed));
    let u_direction = sobol_2d(index, hash2(DIRECTION_PAIR, params.seed));
    var v = Vpl(vec3f(0.0), vec3f(0.0, 0.0, 1.0), vec3f(0.0), 0.0);
    // Of later vertices the density is not known: each stands for an equal part of a sphere around the scene. Chosen.
    let later_area = 4.0 * PI * scene.radius * scene.radius / f32(params.paths);
    let vertices = arrayLength(&walk) / (2u * params.paths);  // of a path at most
    var vertex = 0u;
    var ray = Ray(vec3f(0.0), vec3f(0.0));
    var flux = vec3f(0.0);     // of the ray in flight
    if (path < params.sky_paths) {
        let point = load_point(index % point_count());
        let disc = PI * point.radius * point.radius * f32(point_count()) / f32(params.sky_paths);
        v = sky_vertex(point, disc, u_direction, vec2f(choices.y, u_point.x));
        store(path, vertex, v);
        vertex += 1u;
    } else {
        let light = pick_light(choices.x * (1.0 - scene.environment_pdf));
        let sent = sample_ray_of(light, choices.y, u_point, u_direction);
        let others = f32(params.paths - params.sky_paths) / (1.0 - scene.environment_pdf);
        let hit = trace(sent.ray, FLOAT_MAX);
        if (hit.triangle != NONE && max3(sent.flux) > 0.0) {
            let s = surface_at(hit, sent.ray.direction);
            let cosine = max(abs(dot(s.geometric_normal, sent.ray.direction)), 1e-6);
            let falloff = select(1.0 / (hit.distance * hit.distance), 1.0, sent.parallel);
            let area = 1.0 / max(others * light.probability * sent.ray_density * cosine * falloff, 1e-30);
            v = reflect_flux(s, sent.ray.direction, sent.flux / others, area);
        }
        var first = v;
        if (light.kind <= KIND_SUN) {
            first.flux = vec3f(0.0);
        }
        store(path, vertex, first);
        vertex += 1u;
    }
    while (vertex < vertices) {
        let brightest = max3(v.flux);
        if (brightest <= 0.0) {
            break;
        }
        // Survive in proportion to what the reflection left.
        let pair = FIRST_BOUNCE_PAIR + 2u * vertex;
        let random = sobol_2d(index, hash2(pair, params.seed));
        let survival = select(min(brightest / max(max3(flux), 1e-37), MAX_SURVIVAL), MAX_SURVIVAL, max3(flux) <= 0.0);
        if (random.x >= survival) {
            break;
        }
        flux = v.flux / survival;
        let local = sample_cosine_hemisphere(sobol_2d(index, hash2(pair + 1u, params.seed)));
        let start = v.position + v.normal * ray_offset(scene_extent());
        ray = Ray(start, frame_from_normal(v.normal) * local);
        let hit = trace(ray, FLOAT_MAX);
        v.flux = vec3f(0.0);
        if (hit.triangle == NONE) {
            break;
        }
        v = reflect_flux(surface_at(hit, ray.direction), ray.direction, flux, later_area);
        store(path, vertex, v);
        vertex += 1u;
    }
    v.flux = vec3f(0.0);
    for (; vertex < vertices; vertex += 1u) {
        store(path, vertex, v);
    }
}
