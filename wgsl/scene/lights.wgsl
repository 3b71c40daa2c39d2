// Light sampling: all sources in one list, with densities for multiple importance sampling.
//
// A light is picked in proportion to its power, which `upload/light_table.py` tabulates. A constant environment is not
// in the list: sampling the BRDF finds it at least as well. An emitter with a texture is in it by cells of similar light.
// The densities by which strategies weight a point of it follow its own light, not its cell's: weights need only be the
// same function in all strategies (Veach 1997, section 9.2.2), and so a hit need not find its cell.
#import "scene/emission.wgsl"
#import "scene/environment_sampling.wgsl"
#import "common/random.wgsl"
#import "common/spot.wgsl"

const KIND_POINT: u32 = 0u;
const KIND_SPOT: u32 = 1u;
const KIND_SUN: u32 = 2u;
const KIND_TRIANGLE: u32 = 3u;
const KIND_ENVIRONMENT: u32 = 4u;

struct Light {
    position: vec3f,     // triangle: first vertex; metres relative to the scene's origin
    kind: u32,
    edge1: vec3f,        // triangle: edge; spot, sun: unit direction of travel
    triangle: u32,
    edge2: vec3f,        // triangle: edge; spot: scale and offset of the fall-off, as `spot_falloff` takes them
    sides: u32,          // triangle: 1 shines from the side of edge1 x edge2, 2 from the other; cell: | turn << 2
    color: vec3f,        // intensity W/sr, irradiance W/m2, or radiance W/(m2 sr)
    cumulative: f32,     // probability that this light or one before it is drawn
    probability: f32,    // of this light to be drawn
    of_triangle: f32,    // probability of all cells of the triangle; other lights: `probability`
    cell: vec2u,         // column and row in the triangle's unit square, above them a 1 at the bit of their number; or 0
}

@group(1) @binding(8) var<storage, read> lights: array<Light>;

// Compiled out if the scene has none.
override HAS_EMITTERS: bool = true;

struct LightSample {
    to_light: vec3f,      // from the surface, metres; any length for lights at infinity
    limit: f32,           // end of the shadow ray, in lengths of `to_light`; 0: no light reaches the surface
    weighted: vec3f,      // radiance over density; irradiance at normal incidence for lights without area
    direction: vec3f,     // unit
    pdf: f32,             // for weights, 1/sr; 0 for punctual lights, which no BRDF sample can hit
    ray_density: f32,     // density of `sample_ray_of` at a surface that faces the light, 1/m2
}

// A ray that leaves a light.
struct LightRay {
    ray: Ray,             // of unit direction
    flux: vec3f,          // W; divided by the ray's density
    ray_density: f32,     // 1/m2 at 1 m on a surface that faces it; at any distance if `parallel`
    parallel: bool,
    pdf: f32,             // `sample_light`'s `pdf` of its origin, 1/sr, at 1 m unless `parallel`; punctual: 0
}

const INFINITELY_FAR: f32 = 1e30;

// Returns the share of an emitter's rays that leave through one of its sides.
fn side_share(both_sides: bool) -> f32 {
    return select(1.0, 0.5, both_sides);
}

fn no_light() -> LightSample {
    return LightSample(vec3f(0.0), 0.0, vec3f(0.0), vec3f(0.0), 0.0, 0.0);
}

// Returns the density of parallel light rays across a disc that covers the scene, 1/m2.
fn parallel_density() -> f32 {
    return 1.0 / max(PI * scene.radius * scene.radius, 1e-37);
}

// Returns the density of a punctual light's rays, uniform over the spot's cone or the sphere, 1/sr.
fn direction_density(light: Light) -> f32 {
    if (light.kind == KIND_POINT) {
        return 0.25 * INV_PI;
    }
    return 0.5 * INV_PI * light.edge2.x / light.edge2.y;
}

fn punctual_intensity(light: Light, from_light: vec3f) -> vec3f {
    if (light.kind == KIND_POINT) {
        return light.color;
    }
    return light.color * spot_falloff(from_light, light.edge1, light.edge2.x, light.edge2.y);
}

// Returns the place of the light whose interval of cumulative probability holds `choice` in [0, 1) (binary search).
fn pick_number(choice: f32) -> u32 {
    var low = 0u;
    var high = scene.light_count - 1u;
    while (low < high) {
        let middle = (low + high) / 2u;
        if (lights[middle].cumulative > choice) {
            high = middle;
        } else {
            low = middle + 1u;
        }
    }
    return low;
}

fn pick_light(choice: f32) -> Light {
    return lights[pick_number(choice)];
}

// A point of an emitter.
struct EmitterPoint {
    weights: vec2f,    // of edge1 and edge2
    emission: vec3f,   // W/(m2 sr)
    area: f32,         // over which `weights` are uniform, in areas of the triangle
    density: f32,      // for weights of strategies: of light samples there, 1/m2
}

// Samples a point of a triangle light, uniformly over the triangle or its cell.
fn sample_emitter_point(light: Light, area: f32, u: vec2f) -> EmitterPoint {
    if (HAS_EMISSION_MAPS && light.cell.x != 0u) {
        let cells = vec2f(vec2u(1u) << firstLeadingBit(light.cell));
        let weights = emitter_weights((vec2f(light.cell) + min(u, vec2f(BELOW_ONE))) / cells - 1.0);
        let emission = emission_at(light.triangle, light.color, turn_weights(weights, light.sides >> 2u));
        let density = textured_pdf(load_triangle(light.triangle).material, emission);
        return EmitterPoint(weights, emission, 1.0 / (cells.x * cells.y), density);
    }
    let weights = sample_triangle(u);
    return EmitterPoint(weights, emission_at(light.triangle, light.color, weights), 1.0, light.probability / area);
}

fn sample_triangle_light(light: Light, from_position: vec3f, u: vec2f) -> LightSample {
    let normal = cross(light.edge1, light.edge2);
    let twice_area = length(normal);
    let point = sample_emitter_point(light, 0.5 * twice_area, u);
    let to_light = light.position + point.weights.x * light.edge1 + point.weights.y * light.edge2 - from_position;
    let direction = normalize_or(to_light, vec3f(0.0));
    // Cosine at the light, positive on the side of edge1 x edge2.
    let cosine = -dot(normal, direction) / max(twice_area, 1e-37);
    let squared = dot(to_light, to_light);
    if ((light.sides & select(2u, 1u, cosine > 0.0)) == 0u || cosine == 0.0 || squared <= 0.0) {
        return no_light();
    }
    let pdf = light.probability * 2.0 * squared / (twice_area * abs(cosine));
    let density = abs(cosine) * INV_PI * side_share((light.sides & 3u) == 3u) / squared;
    if (HAS_EMISSION_MAPS && light.cell.x != 0u) {
        return LightSample(
            to_light, STOP_SHORT, point.emission * (point.area / pdf), direction, point.density * squared / abs(cosine),
            density);
    }
    return LightSample(to_light, STOP_SHORT, point.emission / pdf, direction, pdf, density);
}

// Samples a light and a point on it for a surface point. `choice` picks the light, `u` the point.
fn sample_light(from_position: vec3f, choice: f32, u: vec2f) -> LightSample {
    return sample_point_of(pick_light(choice), from_position, u);
}

// Samples a point of a light for a surface point; also divides by the light's probability.
fn sample_point_of(light: Light, from_position: vec3f, u: vec2f) -> LightSample {
    if (HAS_PICTURED_ENVIRONMENT && light.kind == KIND_ENVIRONMENT) {
        let drawn = sample_environment(u);
        let pdf = drawn.w * light.probability;
        if (pdf <= 0.0) {
            return no_light();
        }
        return LightSample(
            drawn.xyz, INFINITELY_FAR, environment_radiance(drawn.xyz) / pdf, drawn.xyz, pdf, parallel_density());
    }
    if (light.kind == KIND_SUN) {
        let direction = -light.edge1;
        return LightSample(
            direction, INFINITELY_FAR, light.color / light.probability, direction, 0.0, parallel_density());
    }
    if (HAS_EMITTERS && light.kind == KIND_TRIANGLE) {
        return sample_triangle_light(light, from_position, u);
    }
    let to_light = light.position - from_position;
    let squared = dot(to_light, to_light);
    if (squared <= 0.0) {
        return no_light();
    }
    let direction = normalize_or(to_light, vec3f(0.0));
    let weighted = punctual_intensity(light, -direction) / (squared * light.probability);
    return LightSample(to_light, STOP_SHORT, weighted, direction, 0.0, direction_density(light) / squared);
}

// Samples a ray that leaves a light; its flux is also divided by the light's probability. `choice` picks an emitter's
// side.
fn sample_ray_of(light: Light, choice: f32, u_point: vec2f, u_direction: vec2f) -> LightRay {
    if (light.kind == KIND_SUN || (HAS_PICTURED_ENVIRONMENT && light.kind == KIND_ENVIRONMENT)) {
        // Light from infinity: start on a disc that covers the scene as the light sees it.
        var drawn = vec4f(-light.edge1, 0.0);
        var power = light.color;
        if (HAS_PICTURED_ENVIRONMENT && light.kind == KIND_ENVIRONMENT) {
            drawn = sample_environment(u_direction);
            power = environment_radiance(drawn.xyz) / max(drawn.w, 1e-37);
        }
        let r = scene.radius * sqrt(u_point.x);
        let phi = TWO_PI * u_point.y;
        let origin = scene.centre
            + frame_from_normal(drawn.xyz) * vec3f(r * cos(phi), r * sin(phi), 1.001 * scene.radius);
        let density = parallel_density();
        return LightRay(
            Ray(origin, -drawn.xyz), power / (density * light.probability), density, true,
            drawn.w * light.probability);
    }
    if (HAS_EMITTERS && light.kind == KIND_TRIANGLE) {
        // Emitter: start at a point of it, with a density proportional to the cosine.
        let normal = cross(light.edge1, light.edge2);
        let twice_area = max(length(normal), 1e-37);
        let point = sample_emitter_point(light, 0.5 * twice_area, u_point);
        let both_sides = (light.sides & 3u) == 3u;
        let flip = (light.sides & 3u) == 2u || (both_sides && choice < 0.5);
        let outward = normal * (select(1.0, -1.0, flip) / twice_area);
        let local = sample_cosine_hemisphere(u_direction);
        let weights = point.weights;
        let position = light.position + weights.x * light.edge1 + weights.y * light.edge2;
        let terms = abs(light.position) + abs(weights.x * light.edge1) + abs(weights.y * light.edge2);
        let share = side_share(both_sides);
        var flux = point.emission * (0.5 * twice_area * PI / (light.probability * share));
        var pdf = light.probability * 2.0 / (twice_area * max(local.z, 1e-20));
        if (HAS_EMISSION_MAPS && light.cell.x != 0u) {
            flux *= point.area;
            pdf = point.density / max(local.z, 1e-20);
        }
        return LightRay(
            Ray(position + outward * ray_offset(outward, terms), frame_from_normal(outward) * local), flux,
            local.z * INV_PI * share, false, pdf);
    }
    // Punctual light: directions are uniform over the sphere or the spot's cone.
    let density = direction_density(light);
    var direction: vec3f;
    let versine = u_direction.x / (TWO_PI * density);
    let sine = sqrt(max(versine * (2.0 - versine), 0.0));
    let phi = TWO_PI * u_direction.y;
    direction = vec3f(sine * cos(phi), sine * sin(phi), 1.0 - versine);
    if (light.kind == KIND_SPOT) {
        direction = frame_from_normal(light.edge1) * direction;
    }
    let flux = punctual_intensity(light, direction) / (density * light.probability);
    return LightRay(Ray(light.position, direction), flux, density, false, 0.0);
}
