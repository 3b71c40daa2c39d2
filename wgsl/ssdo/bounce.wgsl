// One invocation gathers the light that surfaces around a receiver reflect to it: E = pi / N sum_k L(q_k) over the
// directions that hit a surface, q_k; and what its coat reflects, L_coat = 1 / M sum_j f_j cos_j L(q_j) / p_j, over
// directions drawn from the coat with the density p, or from the others if the coat is wide.
//
// Ritschel et al. 2009, section 3: L_pixel cos_s cos_r A / d^2. Departures: A is the area that the direction's solid
// angle dw cuts out of the sender, A = dw d^2 / cos_s; the paper uses pi r_max^2 / N times a strength set by hand. A
// direction thus replaces the environment's light by the sender's, and near senders need no clamp. With directions
// drawn by the cosine, cos_r dw is pi / N. Only the fronts of senders count; the base gets what coats transmit. In:
// hits, radiance of senders, W/(m2 sr). Out: irradiance E, W/m2, and L_coat over coat_tint(), W/(m2 sr), both with the
// depth of `shared/denoise/plane.wgsl`; for L_coat it is 0 without a coat. Errs dark where the senders are in no view,
// and where glossy senders send more towards the receiver than to the camera.
#import "shared/gbuffer/load.wgsl"
#import "shared/gbuffer/tiles.wgsl"
#import "ssdo/sender_light.wgsl"
#import "shared/upsample/grid_pixel.wgsl"
#import "shared/upsample/unrepresented.wgsl"
#import "common/coat.wgsl"
#import "ssdo/lobe.wgsl"

override DIRECTIONS: u32 = 1u;              // N; 0: coats only
override LOBES: u32 = 0u;                   // M
override REFLECTED: bool = false;           // unrepresented pixels get radiance
override SAMPLE_ENVIRONMENT: bool = false;  // stored weights are halved

@group(1) @binding(11) var<storage, read> hits: array<vec2u>;     // packed by `ssdo/hit_code.wgsl`
@group(1) @binding(13) var<storage, read_write> irradiance: array<vec4f>;
@group(1) @binding(14) var<storage, read> occlusion: array<vec4f>;  // w: the depth of `shared/denoise/plane.wgsl`
@group(1) @binding(15) var<storage, read_write> coat: array<vec4f>;

// Returns the irradiance of a pixel, W/m2; `slot`: where its hits are stored.
fn gather(pixel: vec2u, slot: u32) -> vec3f {
    let surface = load_surface(pixel);
    let brdf = gbuffer_brdf(surface);
    let to_eye = -pixel_ray(pixel).direction;
    var sum = vec3f(0.0);
    for (var k = 0u; k < DIRECTIONS; k += 1u) {
        let hit = hits[slot * (DIRECTIONS + LOBES) + k];
        if (hit.x == NO_HIT) {
            continue;
        }
        let arrival = unpack_hit_direction(hit.y);
        var radiance = radiance_of(hit.x, arrival);
        if (HAS_COATS) {
            radiance *= transmitted_from(brdf, surface.normal, arrival.direction, to_eye);
        }
        sum += radiance;
    }
    return sum * (PI * select(1.0, 2.0, SAMPLE_ENVIRONMENT) / f32(max(DIRECTIONS, 1u)));
}

// Returns what a wide coat reflects of the light along directions drawn by the cosine, W/(m2 sr).
fn gather_wide_coat(brdf: Brdf, normal: vec3f, to_eye: vec3f, slot: u32) -> vec3f {
    var sum = vec3f(0.0);
    for (var k = 0u; k < DIRECTIONS; k += 1u) {
        let hit = hits[slot * (DIRECTIONS + LOBES) + k];
        if (hit.x != NO_HIT) {
            let arrival = unpack_hit_direction(hit.y);
            sum += radiance_of(hit.x, arrival) * coat_towards(brdf, normal, to_eye, arrival.direction);
        }
    }
    return sum * (select(1.0, 2.0, SAMPLE_ENVIRONMENT) / f32(max(DIRECTIONS, 1u)));
}

// Returns what a pixel's coat reflects, over its tint, W/(m2 sr), and `depth`; zero without a coat.
fn gather_coat(pixel: vec2u, slot: u32, depth: f32) -> vec4f {
    let surface = load_surface(pixel);
    let brdf = gbuffer_brdf(surface);
    if (!brdf.glossy) {
        return vec4f(0.0);
    }
    let to_eye = -pixel_ray(pixel).direction;
    let inverse = 1.0 / coat_tint(brdf, surface.normal, to_eye);
    if (!draws_lobe(brdf, DIRECTIONS > 0u)) {
        return vec4f(gather_wide_coat(brdf, surface.normal, to_eye, slot) * inverse, depth);
    }
    var sum = vec3f(0.0);
    for (var k = 0u; k < LOBES; k += 1u) {
        let hit = hits[slot * (DIRECTIONS + LOBES) + DIRECTIONS + k];
        if (hit.x == NO_HIT) {
            continue;
        }
        let arrival = unpack_hit_direction(hit.y);
        sum += radiance_of(hit.x, arrival) * lobe_weight_of(brdf, surface.normal, to_eye, arrival.direction);
    }
    return vec4f(sum * inverse / f32(max(LOBES, 1u)), depth);
}

fn gather_of_grid(grid: vec2u) {
    let index = grid.y * grid_size().x + grid.x;
    let depth = occlusion[index].w;
    if (depth > 0.0) {
        if (DIRECTIONS > 0u) {
            irradiance[index] = vec4f(gather(grid_pixel(grid), index), depth);
        }
        if (LOBES > 0u) {
            coat[index] = gather_coat(grid_pixel(grid), index, depth);
        }
    }
}

// Runs per pixel of a tile that shows a surface.
@compute @workgroup_size(8, 8)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) thread: vec3u) {
    let pixel = pixel_of_tile(group, thread, view.size);
    if (all(pixel < view.size)) {
        gather_of_grid(pixel);
    }
}

// Runs per pixel of a coarser grid.
@compute @workgroup_size(8, 8)
fn coarse(@builtin(global_invocation_id) id: vec3u) {
    if (all(id.xy < grid_size())) {
        gather_of_grid(id.xy);
    }
}

// Runs per unrepresented pixel. Out: irradiance, or with REFLECTED the radiance rho E / pi, W/(m2 sr).
@compute @workgroup_size(LIST_GROUP)
fn listed(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let count = unrepresented_count();
    for (var slot = id.x; slot < count; slot += groups.x * LIST_GROUP) {
        let index = unrepresented[slot];
        let pixel = vec2u(index % view.size.x, index / view.size.x);
        if (DIRECTIONS > 0u) {
            let factor = select(vec3f(1.0), gbuffer_brdf(load_surface(pixel)).diffuse * INV_PI, REFLECTED);
            irradiance[index] = vec4f(gather(pixel, slot) * factor, 1.0);
        }
        if (LOBES > 0u) {
            coat[index] = gather_coat(pixel, slot, 1.0);
        }
    }
}
