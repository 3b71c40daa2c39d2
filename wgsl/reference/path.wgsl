// One invocation traces `samples` more paths of one pixel and merges them into its running means.
//
// L_o = L_e + integral f_r L_i cos (Kajiya 1986). Three strategies find a path's last surface before its light; the
// power heuristic combines them (Veach 1997, eq. 9.15 and section 10.2, with light subpaths of at most two vertices):
//   N  next-event estimation: the path's own rays, then a shadow ray to a sampled point of a light
//   B  the path's own rays, then one that follows the BRDF and meets an emitter or the environment
//   L  a light ray, one for each path, whose hit is connected with every vertex of the path
// L finds the bright spot beside a lamp. Densities are those of that last surface's point and of the light's point.
// Layers by number of scatterings: `emission` none, `direct` one, `indirect` two and more. In: the scene, and the means
// so far. Out: means in W/(m2 sr), the sum of squared deviations of their total. Unbiased but for the rays' offset
// (`scene/ray_offset.wgsl`: bright, by gaps and blockers smaller than it). Vertex normals and normal maps that lean far
// from the triangle let some light pass through it, as in other renderers that do not clip their lobes (Mitsuba 3).
// Solid glass refracts: shadow rays do not pass it. Light that smooth solids focus (caustics) is found only if a path meets
// the lamp: of small and punctual lights and the sun almost never, in dots. A mirror's alpha is at least 0.001.
#import "scene/lights.wgsl"
#import "scene/trace.wgsl"
#import "common/random.wgsl"
#import "reference/connect.wgsl"
#import "reference/camera_visibility.wgsl"
#import "reference/pixel_of.wgsl"
#import "reference/arriving.wgsl"
#import "reference/means.wgsl"
#import "reference/runs.wgsl"

// Only surfaces that the picture shows send light, as if there were no others: the best that screen space can find.
override VISIBLE_ONLY: bool = false;
// A run begins no path after this many steps of traversal, which bounds the time of a dispatch and the iterations of a
// loop by what the driver allows. Later runs make up for the missing paths, so the picture is the same.
override STEP_BUDGET: u32 = 6000u;

// Scatterings before Russian roulette, in which a path survives with the probability of its remaining throughput.
// Measured on Cornell, 32 spp: error times run time is 26 % less than with 1, 13 % more than with 5, which traces a
// seventh fewer paths a second.
const ROULETTE_FROM: u32 = 3u;
// Bounds the length of paths in a closed white room: 50 scatterings after ROULETTE_FROM on the average.
const MAX_SURVIVAL: f32 = 0.98;
// Pairs of dimensions of the random numbers: 0 the point in the pixel; 1 to 3 the light ray's choices, point,
// direction; then for each vertex of the path the choices of light and lobe, the BRDF's direction, the point on the
// light.
const FIRST_VERTEX_PAIR: u32 = 4u;
const PAIRS_PER_VERTEX: u32 = 3u;

@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let pixel = pixel_of(params.first_workgroup + workgroup.x, local, params.row_stride);
    if (all(pixel < view.size)) {
        trace_paths(whole_pixel(pixel), pixel.y * view.size.x + pixel.x, params.seed);
    }
}

// Traces more paths of a pixel of the whole picture, whose means are elements `pixel_index` of the buffers.
fn trace_paths(pixel: vec2u, pixel_index: u32, seed: u32) {
    let pixel_seed = hash2(pixel.x, hash2(pixel.y, seed));

    // Load the means. A pixel may be behind the others (STEP_BUDGET), so it counts its own samples.
    let continues = params.settle_index > 0u;
    let done = u32(select(0.0, emission[pixel_index].a, continues));
    let old = load_means(pixel_index, continues);
    var planned = min(params.samples, params.spp - min(done, params.spp));
    if (ADAPTIVE) {
        planned = adaptive_paths(pixel, done);
    }
    // lavapipe (Mesa 22.3) compiles a shader anew for every dispatch if it branches on uniforms alone, and keeps each
    // copy: hence `select`, `&`, and here a condition that is always true but varies.
    let has_lights = (scene.light_count > 0u) & (pixel.x < view.whole.x);
    // Squares are summed about the mean so far, which keeps their difference accurate.
    let centre = old.emission.rgb + old.direct + old.indirect;

    var sums: Sums;
    var sample = 0u;
    var steps = 0u;
    var path_radiance = vec3f(0.0);
    var throughput = vec3f(1.0);
    var depth = 0u;
    var bsdf_pdf = 0.0;                       // of the ray in flight, 1/sr
    var origin_normal = vec3f(0.0);          // geometric normal at the ray's origin
    var origin_density = 0.0;                 // of that vertex by the path's own rays, 1/m2; 0: the camera ray's hit
    var from_light = false;                   // the ray in flight is a light's
    var light_ray = LightRay(Ray(vec3f(0.0), vec3f(0.0)), vec3f(0.0), 0.0, false, 0.0);
    var lit: LightVertex;
    var medium = air();                       // of the ray in flight, at its start
    var rays: Rays;                           // limits of 0: none in flight
    var pending_a = vec3f(0.0);               // radiance if the first shadow ray is unoccluded
    var pending_b = vec3f(0.0);
    var cell_a = NONE;                        // of the guide, that the light of `pending_a` passes
    var cell_b = NONE;                        // that the light ray passes
    var guide: Guide;
    if (ADAPTIVE && HAS_PUNCTUAL_LIGHTS) {
        guide = guide_of(pixel, params.settle_index, centre);
    }
    let use_light_rays = has_lights & (params.bounces > 0u);

    // One iteration is one path vertex; a lane whose path has ended starts its next sample.
    loop {
        let ended = rays.limit <= 0.0 && rays.limit_a <= 0.0 && rays.limit_b <= 0.0;
        if (ended && !from_light) {
            // Finish the sample, begin the next one with a light ray.
            if (sample > 0u) {
                let offset = (path_radiance - centre) / scene.light_unit;
                sums.offset += offset;
                sums.square += offset * offset;
            }
            if (sample == planned || steps > STEP_BUDGET) {
                break;
            }
            sample += 1u;
            rays.index = done + sample - 1u;
            path_radiance = vec3f(0.0);
            lit.offset = -1.0;
            medium = air();
            from_light = use_light_rays;
            if (use_light_rays) {
                let guided = path_light_ray(rays.index, pixel_seed, guide);
                light_ray = guided.sent;
                cell_b = guided.cell;
                rays.seed = ~pixel_seed | 1u;
                rays.main = light_ray.ray;
                rays.limit = select(0.0, FLOAT_MAX, max3(light_ray.flux) > 0.0);
            }
        }
        if (rays.limit <= 0.0 && rays.limit_a <= 0.0 && rays.limit_b <= 0.0) {
            // No ray is in flight when a path starts: send its camera ray.
            from_light = false;
            let jittered = sobol_2d(rays.index, hash2(pixel_seed, 0u));
            let position = select(vec2f(0.5), jittered, view.jitter != 0u);
            rays.main = camera_ray(vec2f(pixel) + position);
            rays.limit = FLOAT_MAX;
            rays.seed = pixel_seed | 1u;
            throughput = vec3f(1.0);
            medium = air();
            depth = 0u;
            origin_density = 0.0;
        }

        // Trace the rays in flight, and add the light of unoccluded shadow rays.
        let found = trace_all(rays);
        steps += found.steps;
        let arrived = rays.limit > 0.0;
        var connected = vec3f(0.0);
        pending_a *= found.tint_a;
        pending_b *= found.tint_b;
        if (rays.limit_a > 0.0 && !found.occluded_a) {
            connected += pending_a;
            // The vertex that cast the shadow rays lies before the ray in flight.
            sums.direct += select(vec3f(0.0), pending_a, depth == 1u);
            sums.indirect += select(pending_a, vec3f(0.0), depth == 1u);
            if (ADAPTIVE && HAS_PUNCTUAL_LIGHTS && depth > 1u) {
                record_found(guide, cell_a, pending_a);
            }
        }
        if (rays.limit_b > 0.0 && !found.occluded_b) {
            connected += pending_b;
            sums.indirect += pending_b;
            if (ADAPTIVE && HAS_PUNCTUAL_LIGHTS) {
                record_found(guide, cell_b, pending_b);
            }
        }
        path_radiance += connected;
        rays.limit_a = 0.0;
        rays.limit_b = 0.0;
        rays.limit = 0.0;
        if (!arrived) {
            continue;
        }

        // Evaluate the surface that the main ray hits, behind those that it has passed.
        let hit_something = found.hit.triangle != NONE;
        let squared_distance = found.hit.distance * found.hit.distance;
        var surface: Surface;
        var cosine_in = 0.0;   // geometric, of the ray that has arrived
        if (hit_something) {
            surface = surface_at(found.hit, rays.main.direction);
            cosine_in = max(abs(dot(surface.geometric_normal, rays.main.direction)), 1e-12);
        }

        var sends = hit_something;
        if (VISIBLE_ONLY && hit_something && (from_light || depth > 0u)) {
            let shown = is_seen_by_camera(surface, rays.main.direction);
            steps += shown.steps;
            sends = shown.by_camera;
        }

        throughput *= found.hit.tint;
        light_ray.flux *= found.hit.tint;
        if (HAS_VOLUMES && hit_something) {
            medium = medium_before(surface, medium);
            let left = volume_transmittance(medium.absorption, found.hit.distance);
            throughput *= left;
            light_ray.flux *= left;
        }
        if (from_light) {
            // Keep the light ray's hit for the vertices of the coming path.
            if (sends && (surface.flags & UNLIT) == 0u) {
                lit = light_vertex(surface, light_ray, squared_distance, cosine_in);
            }
            continue;
        }

        // Add the emission that the ray has hit (B).
        let met = arriving_at(surface, hit_something, rays.main.direction, squared_distance, cosine_in, depth == 0u);
        // Glass covers a share of the environment.
        let covered = select(select(0.0, 1.0 - luminance(throughput), HAS_TINTS), 1.0, hit_something);
        sums.hits += select(0.0, covered, depth == 0u);
        if (max3(met.radiance) > 0.0) {
            if (depth == 0u) {
                sums.emission += throughput * met.radiance;
                path_radiance += throughput * met.radiance;
            } else {
                let density = met.ray_density * abs(dot(origin_normal, rays.main.direction));
                let weighted = throughput * met.radiance
                    * weight_of_hit(bsdf_pdf, met.light_pdf, origin_density, density);
                path_radiance += weighted;
                sums.direct += select(vec3f(0.0), weighted, depth == 1u);
                sums.indirect += select(weighted, vec3f(0.0), depth == 1u);
            }
        }
        if (!sends || depth > params.bounces || (surface.flags & UNLIT) != 0u) {
            continue;
        }
        origin_density = select(bsdf_pdf * cosine_in / squared_distance, 0.0, depth == 0u);
        origin_normal = surface.geometric_normal;

        // Connect to a light (N) and to the light ray's hit (L).
        let dimension = FIRST_VERTEX_PAIR + depth * PAIRS_PER_VERTEX;
        let choices = sobol_2d(rays.index, hash2(pixel_seed, dimension));
        let brdf = surface_brdf(surface);
        let frame = frame_from_normal(surface.normal);
        let vertex = PathVertex(
            surface, brdf, frame, -rays.main.direction * frame, throughput, origin_density, medium);
        if (has_lights) {
            let point = sobol_2d(rays.index, hash2(pixel_seed, dimension + 2u));
            let to_light = connect_light(vertex, choices.x, point, guide);
            rays.shadow_a = to_light.ray;
            rays.limit_a = to_light.limit;
            pending_a = to_light.radiance;
            cell_a = to_light.cell;
        }
        if (lit.offset >= 0.0 && depth < params.bounces) {
            let to_vertex = connect_light_vertex(vertex, lit);
            rays.shadow_b = to_vertex.ray;
            rays.limit_b = to_vertex.limit;
            pending_b = to_vertex.radiance;
        }
        depth += 1u;

        // Sample the next direction by the BRDF. The last ray counts only if it can hit a light.
        if ((depth > params.bounces) & (scene.hittable_light == 0u)) {
            continue;
        }
        let next = sample_brdf(brdf, vertex.w_o, sobol_2d(rays.index, hash2(pixel_seed, dimension + 1u)), choices.y);
        if (next.pdf <= 0.0) {
            continue;
        }
        let carried = throughput * next.weight;
        let direction = normalize(frame * next.w_i);
        if (!is_finite(carried) || !sides_agree(surface, brdf, direction, next.w_i)) {
            continue;
        }
        medium = medium_beyond(surface, direction, medium);
        var survival = 1.0;
        if (depth > ROULETTE_FROM) {
            // Radiance is smaller in air than in a solid by the square of the index.
            survival = min(max3(carried) * medium.squared_index, MAX_SURVIVAL);
            if (unit_float(hash2(pixel_seed ^ 0x9e3779b9u, hash2(rays.index, depth))) >= survival) {
                continue;
            }
        }
        throughput *= next.weight / survival;
        bsdf_pdf = next.pdf;
        rays.main = Ray(leave_surface(surface, direction), direction);
        rays.limit = FLOAT_MAX;
        rays.seed = hash2(pixel_seed, depth) | 1u;
    }

    sums.count = sample;
    merge_means(pixel_index, old, sums);
    if (ADAPTIVE) {
        report_run(pixel, done + sample);
    }
}
