// One invocation traces `samples` more paths of one pixel and merges them into its running means.
//
// L_o = L_e + integral f_r L_i cos (Kajiya 1986), by next-event estimation with multiple importance sampling (Veach 1997,
// eq. 9.15) and Russian roulette. Split by scatterings: `emission` none, `direct` one, `indirect` two and more.
// In: the scene, and the means so far. Out: means in W/(m2 sr), the sum of squared deviations of their total.
// Unbiased, but for light through leaks smaller than the rays' offset.
#import "scene/lights.wgsl"
#import "common/random.wgsl"

struct Params {
    settle_index: u32,    // runs since the picture last changed; 0 starts over
    first_workgroup: u32,
    samples: u32,         // paths per pixel and run
    spp: u32,             // paths per pixel in all
    bounces: u32,         // indirect bounces; scatterings are one more
    seed: u32,
}

@group(1) @binding(11) var<uniform> params: Params;
@group(1) @binding(12) var previous_emission: texture_2d<f32>;
@group(1) @binding(13) var previous_direct: texture_2d<f32>;
@group(1) @binding(14) var previous_indirect: texture_2d<f32>;
@group(1) @binding(15) var previous_deviation: texture_2d<f32>;
@group(1) @binding(16) var emission: texture_storage_2d<rgba32float, write>;   // a: number of samples
@group(1) @binding(17) var direct: texture_storage_2d<rgba32float, write>;
@group(1) @binding(18) var indirect: texture_storage_2d<rgba32float, write>;
@group(1) @binding(19) var deviation: texture_storage_2d<rgba32float, write>;  // sum of (x - mean)^2

// Paths may die from this many scatterings on, with the probability that their throughput lost.
const ROULETTE_FROM: u32 = 1u;
// Never certain to go on, so that a closed white room ends, too.
const MAX_SURVIVAL: f32 = 0.98;
// Random numbers of a path vertex, as pairs of dimensions: light and BRDF choice, BRDF, point on the light.
const PAIRS_PER_VERTEX: u32 = 3u;

// Tiles of 8 x 8 pixels in reading order, so that neighbours in a SIMD group are neighbours in the picture.
fn pixel_of(workgroup: u32, local: u32) -> vec2u {
    let tiles_x = (view.size.x + 7u) / 8u;
    return vec2u(workgroup % tiles_x, workgroup / tiles_x) * 8u + vec2u(local % 8u, local / 8u);
}

@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let pixel = pixel_of(params.first_workgroup + workgroup.x, local);
    if (any(pixel >= view.size)) {
        return;
    }
    let done = params.settle_index * params.samples;
    let count = min(params.samples, params.spp - min(done, params.spp));
    let pixel_seed = hash2(pixel.x, hash2(pixel.y, params.seed));

    var old_emission = vec4f(0.0);
    var old_direct = vec3f(0.0);
    var old_indirect = vec3f(0.0);
    var old_deviation = vec3f(0.0);
    if (params.settle_index > 0u) {
        old_emission = textureLoad(previous_emission, pixel, 0);
        old_direct = textureLoad(previous_direct, pixel, 0).rgb;
        old_indirect = textureLoad(previous_indirect, pixel, 0).rgb;
        old_deviation = textureLoad(previous_deviation, pixel, 0).rgb;
    }
    // Squares are summed about the mean so far, which keeps their difference accurate.
    let centre = old_emission.rgb + old_direct + old_indirect;

    var sum_emission = vec3f(0.0);
    var sum_direct = vec3f(0.0);
    var sum_indirect = vec3f(0.0);
    var sum_offset = vec3f(0.0);
    var sum_square = vec3f(0.0);

    var sample = 0u;
    var path_radiance = vec3f(0.0);
    var throughput = vec3f(1.0);
    var depth = 0u;
    var bsdf_pdf = 0.0;                       // of the ray in flight, 1/sr
    var ray = Ray(vec3f(0.0), vec3f(0.0));
    var limit = 0.0;                          // 0: no ray in flight
    var shadow = Ray(vec3f(0.0), vec3f(0.0));
    var shadow_limit = 0.0;                   // 0: no light to connect to
    var pending = vec3f(0.0);                 // what arrives if the shadow ray is free

    // One iteration is one path vertex; a lane whose path has ended goes on with its next sample.
    loop {
        if (limit <= 0.0 && shadow_limit <= 0.0) {
            if (sample > 0u) {
                let offset = path_radiance - centre;
                sum_offset += offset;
                sum_square += offset * offset;
            }
            if (sample == count) {
                break;
            }
            var position = vec2f(0.5);
            if (view.jitter != 0u) {
                position = sobol_2d(done + sample, hash2(pixel_seed, 0u));
            }
            ray = camera_ray(vec2f(pixel) + position);
            limit = FLOAT_MAX;
            throughput = vec3f(1.0);
            path_radiance = vec3f(0.0);
            depth = 0u;
            sample += 1u;
        }

        let found = trace_pair(shadow, shadow_limit, ray, limit);
        if (shadow_limit > 0.0 && !found.occluded) {
            path_radiance += pending;
            // The vertex that cast the shadow ray lies before the ray in flight.
            if (depth == 1u) {
                sum_direct += pending;
            } else {
                sum_indirect += pending;
            }
        }
        shadow_limit = 0.0;
        if (limit <= 0.0) {
            continue;
        }
        limit = 0.0;

        // Add what shines from where the ray has arrived.
        var arriving: vec3f;
        var surface: Surface;
        let hit_something = found.hit.triangle != NONE;
        var light_pdf = 0.0;
        if (hit_something) {
            surface = surface_at(found.hit, ray.direction);
            arriving = surface.emission;
            if ((surface.flags & UNLIT) != 0u) {
                arriving = select(vec3f(0.0), surface.base_color, depth == 0u);
            }
            let cosine = abs(dot(surface.geometric_normal, ray.direction));
            light_pdf = surface.emitter_pdf * found.hit.distance * found.hit.distance / max(cosine, 1e-12);
        } else {
            arriving = environment_radiance(ray.direction);
            light_pdf = environment_pdf(ray.direction);
        }
        if (max3(arriving) > 0.0) {
            if (depth == 0u) {
                sum_emission += arriving;
                path_radiance += arriving;
            } else {
                let weighted = throughput * arriving * power_heuristic(bsdf_pdf, light_pdf);
                path_radiance += weighted;
                if (depth == 1u) {
                    sum_direct += weighted;
                } else {
                    sum_indirect += weighted;
                }
            }
        }
        if (!hit_something || depth > params.bounces || (surface.flags & UNLIT) != 0u) {
            continue;
        }

        let index = done + sample - 1u;
        let dimension = 1u + depth * PAIRS_PER_VERTEX;
        let choices = sobol_2d(index, hash2(pixel_seed, dimension));
        let brdf = surface_brdf(surface);
        let frame = frame_from_normal(surface.normal);
        let w_o = -ray.direction * frame;

        // Connect to a light.
        if (scene.light_count > 0u) {
            let light = sample_light(surface.position, choices.x, sobol_2d(index, hash2(pixel_seed, dimension + 2u)));
            let f = evaluate_brdf(brdf, w_o, light.direction * frame);
            let cosine = dot(surface.normal, light.direction);
            if (light.limit > 0.0 && f.w > 0.0 && cosine > 0.0) {
                var weight = 1.0;
                if (light.pdf > 0.0) {
                    weight = power_heuristic(light.pdf, f.w);
                }
                pending = throughput * f.rgb * cosine * light.weighted * weight;
                if (max3(pending) > 0.0) {
                    let start = leave_surface(surface, light.direction);
                    // The end stays where it is: shift the start only.
                    let shift = select(vec3f(0.0), start - surface.position, light.limit < INFINITELY_FAR);
                    shadow = Ray(start, light.to_light - shift);
                    shadow_limit = light.limit;
                }
            }
        }
        depth += 1u;

        // Go on in a direction that follows the BRDF, unless nothing that shines can be met any more.
        if (depth > params.bounces && scene.hittable_light == 0u) {
            continue;
        }
        let next = sample_brdf(brdf, w_o, sobol_2d(index, hash2(pixel_seed, dimension + 1u)), choices.y);
        if (next.pdf <= 0.0) {
            continue;
        }
        var survival = 1.0;
        if (depth > ROULETTE_FROM) {
            survival = min(max3(throughput * next.weight), MAX_SURVIVAL);
            if (unit_float(hash2(pixel_seed ^ 0x9e3779b9u, hash2(index, depth))) >= survival) {
                continue;
            }
        }
        throughput *= next.weight / survival;
        bsdf_pdf = next.pdf;
        let direction = normalize(frame * next.w_i);
        ray = Ray(leave_surface(surface, direction), direction);
        limit = FLOAT_MAX;
    }

    // Merge the new samples with the old ones (Chan et al. 1979).
    let old_count = old_emission.a;
    let new_count = f32(count);
    let total = old_count + new_count;
    if (total == 0.0) {
        return;
    }
    let share = new_count / total;
    let per_new = 1.0 / max(new_count, 1.0);
    let mean_offset = sum_offset * per_new;
    let squares = max(sum_square - new_count * mean_offset * mean_offset, vec3f(0.0));
    let between = mean_offset * mean_offset * (old_count * share);
    textureStore(emission, pixel, vec4f(mix(old_emission.rgb, sum_emission * per_new, share), total));
    textureStore(direct, pixel, vec4f(mix(old_direct, sum_direct * per_new, share), 1.0));
    textureStore(indirect, pixel, vec4f(mix(old_indirect, sum_indirect * per_new, share), 1.0));
    textureStore(deviation, pixel, vec4f(old_deviation + squares + between, 1.0));
}
