// One invocation computes the environment's light that a pixel's coat reflects, occluded: L_coat = 1 / M sum_j f_j cos_j
// L(w_j) / p_j over the directions w_j that leave the scene, drawn from the coat with the density p, or by the cosine if
// the coat is wide.
//
// L is the environment filtered to about the solid angle of one direction of a square's set (filtered importance
// sampling, Krivanek and Colbert 2008). In: G-buffer, the directions and whether they leave the scene, prefiltered
// environment. Out: L_coat over coat_tint(), W/(m2 sr), and the depth of `shared/denoise/plane.wgsl`, 0 without a coat;
// under a constant environment also the same sum over all directions, since the ratio has no noise where nothing
// occludes. Errs blurry, by that angle.
#import "shared/gbuffer/load.wgsl"
#import "shared/gbuffer/tiles.wgsl"
#import "deferred/environment/ambient.wgsl"
#import "common/coat.wgsl"
#import "shared/denoise/plane.wgsl"
#import "shared/upsample/grid_pixel.wgsl"
#import "ssdo/hit_code.wgsl"
#import "ssdo/lobe.wgsl"
#import "shared/upsample/unrepresented.wgsl"

override DIRECTIONS: u32 = 1u;  // drawn by the cosine
override LOBES: u32 = 1u;       // drawn from the coat
override INTERLEAVE: u32 = 4u;  // side of the squares that share a set of directions

@group(1) @binding(11) var<storage, read> hits: array<vec2u>;     // packed by `ssdo/hit_code.wgsl`
@group(1) @binding(12) var<storage, read_write> coat: array<vec4f>;
@group(1) @binding(13) var<storage, read_write> unoccluded: array<vec4f>;  // under a constant environment

// Returns the light of one direction, times pi or the inverse of its density, W/(m2 sr); `count`: directions per pixel.
fn reflected_from(brdf: Brdf, normal: vec3f, to_eye: vec3f, direction: vec3f, by_lobe: bool, count: u32) -> vec3f {
    let frame = frame_from_normal(normal);
    let w_i = direction * frame;
    let f = evaluate_brdf(coat_of(brdf), to_eye * frame, w_i);
    let density = select(max(w_i.z, 0.0) * INV_PI, f.w, by_lobe);
    if (density <= 0.0) {
        return vec3f(0.0);
    }
    let angle = 1.0 / (density * f32(count * INTERLEAVE * INTERLEAVE));
    let alpha = clamp(sqrt(0.25 * INV_PI * angle), MIN_ALPHA, 1.0);
    return f.rgb * (w_i.z / density) * ambient_lobe(direction, alpha);
}

// The light of a pixel's coat, of the free directions and of all, over its tint, W/(m2 sr); depth 0: there is no coat.
struct SkyCoat {
    visible: vec3f,
    whole: vec3f,
    depth: f32,
}

// `slot`: where the pixel's directions are stored.
fn gather_sky(pixel: vec2u, slot: u32) -> SkyCoat {
    let seen = load_distance(pixel);
    let surface = load_surface(pixel);
    let brdf = gbuffer_brdf(surface);
    if (seen <= 0.0 || (surface.flags & GBUFFER_UNLIT) != 0u || !brdf.glossy) {
        return SkyCoat(vec3f(0.0), vec3f(0.0), 0.0);
    }
    let ray = pixel_ray(pixel);
    let to_eye = -ray.direction;
    let by_lobe = draws_lobe(brdf, DIRECTIONS > 0u);
    let count = select(DIRECTIONS, LOBES, by_lobe);
    let first = slot * (DIRECTIONS + LOBES) + select(0u, DIRECTIONS, by_lobe);
    var visible = vec3f(0.0);
    var whole = vec3f(0.0);
    for (var k = 0u; k < max(DIRECTIONS, LOBES); k += 1u) {
        let hit = hits[first + min(k, count - 1u)];
        let is_free = hit.x == NO_HIT;
        if (k < count && (is_free || !HAS_PICTURED_ENVIRONMENT)) {
            // Hits that have light keep their direction in fewer bits.
            var direction = unpack_hit_direction(hit.y).direction;
            if (hit.x >= DARK_HIT) {
                direction = octahedral_decode(unpack2x16snorm(hit.y));
            }
            let light = reflected_from(brdf, surface.normal, to_eye, direction, by_lobe, count);
            whole += light;
            visible += select(vec3f(0.0), light, is_free);
        }
    }
    let inverse = 1.0 / (f32(count) * coat_tint(brdf, surface.normal, to_eye));
    return SkyCoat(visible * inverse, whole * inverse, plane_depth(ray, seen));
}

fn gather_of_grid(grid: vec2u) {
    let index = grid.y * grid_size().x + grid.x;
    let found = gather_sky(grid_pixel(grid), index);
    coat[index] = vec4f(found.visible, found.depth);
    if (!HAS_PICTURED_ENVIRONMENT) {
        unoccluded[index] = vec4f(found.whole, 1.0);
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

// Runs per unrepresented pixel. Out: under a constant environment, the ratio.
@compute @workgroup_size(LIST_GROUP)
fn listed(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let count = unrepresented_count();
    for (var slot = id.x; slot < count; slot += groups.x * LIST_GROUP) {
        let index = unrepresented[slot];
        let found = gather_sky(vec2u(index % view.size.x, index / view.size.x), slot);
        let ratio = found.visible / max(found.whole, vec3f(1e-30));
        coat[index] = vec4f(select(ratio, found.visible, HAS_PICTURED_ENVIRONMENT), 1.0);
    }
}
