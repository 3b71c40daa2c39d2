// One invocation adds to a pixel's irradiance the light that rays have found along its undecided directions:
// E += pi / (N R) sum_k L_k over the N R entries of its slices (`ssdo/slices.wgsl`).
//
// In: results of rays, radiance of senders, W/(m2 sr), G-buffer. Out: irradiance E, W/m2, or radiance, added. Exact,
// but for radiance_of().
#import "shared/gbuffer/load.wgsl"
#import "ssdo/sender_light.wgsl"
#import "shared/upsample/grid_pixel.wgsl"
#import "shared/upsample/unrepresented.wgsl"
#import "common/coat.wgsl"

override ENTRIES: u32 = 1u;        // N R
override REFLECTED: bool = false;  // unrepresented pixels have radiance: rho E / pi, W/(m2 sr)

@group(1) @binding(11) var<storage, read_write> result: array<vec4f>;
@group(1) @binding(13) var<storage, read> hits: array<vec2u>;  // packed by `ssdo/hit_code.wgsl`

// Returns the irradiance of a pixel's entries, W/m2. `slot`: their index.
fn light_of_rays(pixel: vec2u, slot: u32) -> vec3f {
    let surface = load_surface(pixel);
    let brdf = gbuffer_brdf(surface);
    let to_eye = -pixel_ray(pixel).direction;
    var sum = vec3f(0.0);
    for (var k = 0u; k < ENTRIES; k += 1u) {
        let hit = hits[slot * ENTRIES + k];
        if (hit.x == NO_HIT) {
            continue;
        }
        let arrival = unpack_hit_direction(hit.y);
        var light = radiance_of(hit.x, arrival);
        if (HAS_COATS) {
            light *= transmitted_from(brdf, surface.normal, arrival.direction, to_eye);
        }
        sum += light;
    }
    return sum * (PI / f32(ENTRIES));
}

// Runs per pixel of the grid.
@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (all(id.xy < grid_size())) {
        let slot = id.y * grid_size().x + id.x;
        if (result[slot].w > 0.0) {
            result[slot] += vec4f(light_of_rays(grid_pixel(id.xy), slot), 0.0);
        }
    }
}

// Runs per unrepresented pixel.
@compute @workgroup_size(LIST_GROUP)
fn listed(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let count = unrepresented_count();
    for (var slot = id.x; slot < count; slot += groups.x * LIST_GROUP) {
        let index = unrepresented[slot];
        let pixel = vec2u(index % view.size.x, index / view.size.x);
        if (result[index].w > 0.0) {
            let factor = select(vec3f(1.0), gbuffer_brdf(load_surface(pixel)).diffuse * INV_PI, REFLECTED);
            result[index] += vec4f(light_of_rays(pixel, slot) * factor, 0.0);
        }
    }
}
