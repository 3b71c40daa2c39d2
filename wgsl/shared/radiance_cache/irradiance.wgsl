// A sample of the irradiance of a surface point, by a path that ends at a known cell of the radiance cache.
//
// E = sum_v (prod_j<v rho_j) (E_light,v + pi L_hit,v w) + prod rho E_cell. Each vertex v takes one sample of the lights
// with a shadow ray and one direction by the cosine, which may meet an emitter or the environment; the balance heuristic
// combines both (Veach and Guibas 1995). Unbiased if the means of cells are; surfaces reflect as if they were matte, with
// all that they reflect. With DIRECT_ONLY only the light of sources.
#import "scene/lights.wgsl"
#import "shared/radiance_cache/hits.wgsl"
#import "shared/radiance_cache/find.wgsl"
#import "shared/radiance_cache/reflectance.wgsl"

override DIRECT_ONLY: bool = false;

// A path ends at a cell whose mean counts at least this number of updates; before, it goes on.
const KNOWN_UPDATES: u32 = 4u;
// Vertices without Russian roulette; most vertices; most chance to survive.
const ROULETTE_FROM: u32 = 2u;
const MOST_VERTICES: u32 = 64u;
const MOST_SURVIVAL: f32 = 0.95;
// Pairs of random numbers of a vertex.
const VERTEX_PAIRS: u32 = 4u;

// Light of a source that arrives unless something blocks it.
struct SourceLight {
    irradiance: vec3f,  // W/m2
    ray: Ray,
    limit: f32,         // 0: none
}

// Samples the lights at a surface point.
fn sample_source(s: Surface, choice: f32, u: vec2f) -> SourceLight {
    let light = sample_light(s.position, choice, u);
    let cosine = dot(s.normal, light.direction);
    let faces = light.limit > 0.0 && cosine > 0.0;
    // The weight against the cosine's density; punctual lights have a pdf of 0.
    let own = select(0.0, cosine * INV_PI, light.pdf > 0.0);
    let weight = select(1.0, light.pdf / max(light.pdf + own, 1e-37), light.pdf > 0.0);
    let start = leave_surface(s, light.direction);
    let shift = select(vec3f(0.0), start - s.position, light.limit < INFINITELY_FAR);
    return SourceLight(
        select(vec3f(0.0), light.weighted * (cosine * weight), faces), Ray(start, light.to_light - shift),
        select(0.0, light.limit, faces));
}

// Returns the weight of a light met by a direction of density cosine / pi; `light_pdf`: of the light's samples, 1/sr.
fn weight_of_met(cosine: f32, light_pdf: f32) -> f32 {
    let own = cosine * INV_PI;
    return own / max(own + light_pdf, 1e-37);
}

// Returns pi times the radiance that a ray of density `cosine` / pi brings from sources, W/m2.
fn met_light(hit: Hit, next: Surface, direction: vec3f, cosine: f32) -> vec3f {
    if (hit.triangle == NONE) {
        return PI * environment_radiance(direction) * weight_of_met(cosine, environment_pdf(direction));
    }
    let leaving = max(abs(dot(next.geometric_normal, direction)), 1e-12);
    let lit = select(next.emission, vec3f(0.0), (next.flags & UNLIT) != 0u);
    return PI * lit * weight_of_met(cosine, next.emitter_pdf * hit.distance * hit.distance / leaving);
}

// Returns a sample of the irradiance, W/m2. `index`: of the sample in the sequence of `seed`.
fn irradiance_by_path(start: Surface, index: u32, seed: u32) -> vec3f {
    var s = start;
    var sum = vec3f(0.0);
    var carried = vec3f(1.0);
    // Written so that the condition varies: lavapipe compiles branches on uniforms anew for each dispatch.
    let has_lights = (scene.light_count > 0u) & (start.offset >= 0.0);
    let follows = select(0.0, FLOAT_MAX, !DIRECT_ONLY | ((scene.hittable_light != 0u) & (start.offset >= 0.0)));
    for (var vertex = 0u; vertex < MOST_VERTICES; vertex += 1u) {
        // Send a ray to a light and one by the cosine.
        let pair = hash2(seed, vertex * VERTEX_PAIRS);
        let choices = sobol_2d(index, pair);
        var rays: Rays;
        var source: SourceLight;
        if (has_lights) {
            source = sample_source(s, choices.x, sobol_2d(index, pair + 1u));
            rays.shadow_a = source.ray;
            rays.limit_a = source.limit;
        }
        let local = sample_cosine_hemisphere(sobol_2d(index, pair + 2u));
        let direction = frame_from_normal(s.normal) * local;
        rays.main = Ray(leave_surface(s, direction), direction);
        rays.limit = follows;
        let found = trace_all(rays);
        sum += carried * select(source.irradiance * found.tint_a, vec3f(0.0), found.occluded_a);
        if (follows <= 0.0) {
            break;
        }
        // Add the source that the ray meets, behind what it has passed.
        carried *= found.hit.tint;
        var next: Surface;
        if (found.hit.triangle != NONE) {
            next = surface_at(found.hit, direction);
        }
        sum += carried * met_light(found.hit, next, direction, local.z);
        if (DIRECT_ONLY || found.hit.triangle == NONE || (next.flags & UNLIT) != 0u) {
            break;
        }
        // End at a known cell, or by Russian roulette.
        carried *= reflectance_of(next);
        let side = select(-next.geometric_normal, next.geometric_normal, next.front);
        let cell = find_cell(cell_key(next.position, side, sobol_2d(index, pair + 3u)));
        if (cell != NO_CELL) {
            let known = cells[cell];
            if (updates_of(known.state) >= KNOWN_UPDATES) {
                sum += carried * known.irradiance;
                break;
            }
        }
        let survival = select(1.0, min(max3(carried), MOST_SURVIVAL), vertex >= ROULETTE_FROM);
        if (choices.y >= survival) {
            break;
        }
        carried /= survival;
        s = next;
    }
    return sum;
}
