// One invocation lights one pixel whose shadow filter was undecided, with a shadow ray to each undecided light (Hertel
// et al. 2009, "A Hybrid GPU Rendering Pipeline for Alias-Free Hard Shadows").
//
// L = ambient + sum_i f_r(w_o, w_i) E_i cos_i V_i. In: the list of pixels, the scene. Out: direct, W/(m2 sr): the first
// pass overwrites it, later ones add further lights. Errs bright where the filter was decided but missed blockers
// thinner than a texel.
#import "scene/trace.wgsl"
#import "shared/gbuffer/visible_surface.wgsl"
#import "shared/gbuffer/read.wgsl"
#import "deferred/direct/lighting.wgsl"
#import "deferred/environment/ambient.wgsl"

@group(1) @binding(11) var<storage, read_write> direct: array<vec4f>;
@group(1) @binding(12) var<storage, read> edges: array<u32>;
@group(1) @binding(13) var<storage, read> edge_groups: array<u32>;
@group(1) @binding(15) var<storage, read> sky: array<vec4f>;  // W/(m2 sr)
@group(1) @binding(19) var<uniform> params: Params;

override SKY: bool = false;  // `sky` has the environment's light, occluded

// The driver cuts loops after a number of iterations (STEP_BUDGET).
override CUTS_LOOPS: bool = true;

struct Params {
    first: u32,  // first light of this pass
    end: u32,    // light after its last one
}

// After this many ray steps an invocation filters instead: llvmpipe (Mesa 22.3) silently ends all loops of an
// invocation after 65,535 iterations together, which would lose light. A SIMD group takes the steps of its slowest
// lane, so the budget is a quarter of that.
const STEP_BUDGET: u32 = 16000u;

@compute @workgroup_size(EDGE_GROUP)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    var steps = 0u;
    for (var slot = id.x; slot < edge_groups[3]; slot += groups.x * EDGE_GROUP) {
        let index = edges[slot];
        let pixel = vec2u(index % view.size.x, index / view.size.x);
        let seen = load_visibility(pixel);
        let ray = pixel_ray(pixel);
        let triangle = load_triangle(seen.x);
        let s = surface_on(triangle, hit_on_triangle(ray, triangle, seen.x, seen.y), ray.direction);
        // Light the pixel as `light.wgsl` does, bit for bit; rays start from the exact hit.
        let surface = load_surface(pixel);
        let r = receiver(
            ray.origin + ray.direction * load_distance(pixel), surface.normal, surface.geometric_normal,
            gbuffer_brdf(surface), -ray.direction);
        var ambient: vec3f;
        if (SKY) {
            ambient = sky[index].rgb;
        } else {
            ambient = ambient_radiance(r.brdf, r.normal, -ray.direction);
        }
        var sum = select(direct[index].rgb, ambient, params.first == 0u);
        let count = load_light_count();
        let end = min(count, params.end);
        for (var number = params.first; number < end; number += 1u) {
            let light = load_light(number);
            let incident = light_at(light, r.position);
            let radiance = reflected(r, incident);
            if (max3(radiance) <= 0.0) {
                continue;
            }
            let verdict = shadow_verdict(light, count, r.position, r.geometric_normal, incident.direction);
            var lit = vec3f(verdict.lit);
            if (verdict.lit == UNDECIDED && CUTS_LOOPS && steps > STEP_BUDGET) {
                lit = vec3f(shadow_filter(light, count, r.position, r.geometric_normal, incident.direction));
            } else if (verdict.lit == UNDECIDED) {
                let start = leave_surface(s, incident.direction);
                let is_sun = light.kind == DIRECT_SUN;
                // Shift only the start; the end stays.
                let way = incident.to_light - select(start - s.position, vec3f(0.0), is_sun);
                let rays_end = min(verdict.reach, select(STOP_SHORT, FLOAT_MAX, is_sun));
                let shadow = Ray(start, way);
                let found = trace_shadow(shadow, rays_end);
                lit = select(found.tint_a, vec3f(0.0), found.occluded_a);
                steps += found.steps;
            }
            sum += lit * radiance;
        }
        direct[index] = vec4f(sum, 1.0);
    }
}
