// Directions drawn from the hemisphere of a receiver, and the environment's light from them, over what arrives without
// occluders.
//
// Directions are drawn by the cosine. With SAMPLE_ENVIRONMENT every other one is drawn by importance sampling of the
// environment; weights are those of the balance heuristic (Veach and Guibas 1995).
#import "deferred/environment/ambient.wgsl"
#import "scene/environment_sampling.wgsl"
#import "common/random.wgsl"

override DIRECTIONAL: bool = true;         // false: all light counts alike, ambient occlusion
override SAMPLE_ENVIRONMENT: bool = false;

// Draws unit direction `number` of the world; `frame`: axes about the normal.
fn draw_direction(frame: mat3x3f, number: u32, seed: u32) -> vec3f {
    if (!SAMPLE_ENVIRONMENT) {
        return frame * sample_cosine_hemisphere(sobol_2d(number, seed));
    }
    let u = sobol_2d(number / 2u, hash2(number & 1u, seed));
    if ((number & 1u) != 0u) {
        return sample_environment(u).xyz;
    }
    return frame * sample_cosine_hemisphere(u);
}

// Returns cosine / (pi pdf) of a direction, at most 2.
fn direction_weight(direction: vec3f, normal: vec3f) -> f32 {
    if (!SAMPLE_ENVIRONMENT) {
        return 1.0;
    }
    let cosine_pdf = max(dot(normal, direction), 0.0) * INV_PI;
    let picture_pdf = environment_pdf(direction) / max(scene.environment_pdf, 1e-9);
    return 2.0 * cosine_pdf / max(cosine_pdf + picture_pdf, 1e-30);
}

// Returns the mean of L over the hemisphere of a normal, by which radiance_from() divides.
fn mean_radiance(normal: vec3f) -> vec3f {
    if (HAS_ENVIRONMENT && HAS_PICTURED_ENVIRONMENT && DIRECTIONAL && !SAMPLE_ENVIRONMENT) {
        return max(load_ambient_map(0u, picture_from_world(normal)), vec3f(1e-30));
    }
    return vec3f(1.0);
}

// Returns L of a direction, divided by its mean over the hemisphere unless SAMPLE_ENVIRONMENT. `lobe`: number of the
// environment's prefiltered map that is L.
fn radiance_from(direction: vec3f, mean: vec3f, lobe: u32) -> vec3f {
    if (SAMPLE_ENVIRONMENT) {
        return environment_radiance(direction);
    }
    if (!HAS_ENVIRONMENT || !HAS_PICTURED_ENVIRONMENT || !DIRECTIONAL) {
        return vec3f(1.0);
    }
    return load_ambient_map(lobe, picture_from_world(direction)) / mean;
}
