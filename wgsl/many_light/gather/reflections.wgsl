// One invocation finds the light that the coat at a pixel of the grid reflects by a ray, where the lobe is narrow: VPLs
// are too sparse for such a lobe.
//
// L / tint = f_r cos / density L(y) / tint, the ray's direction drawn from the coat; L(y) of `hit_light.wgsl`. The base's
// light stays that of the VPLs. In: G-buffer, scene, VPLs. Out: the coat's radiance over `coat_tint`, W/(m2 sr), instead of
// that by VPLs. Errs by what `hit_light.wgsl` leaves out.
#import "scene/sequence.wgsl"
#import "deferred/environment/reflectance.wgsl"
#import "many_light/gather/hit_light.wgsl"
#import "many_light/gather/receiver.wgsl"
#import "shared/upsample/grid_pixel.wgsl"

@group(1) @binding(11) var<storage, read_write> glossy: array<vec4f>;
@group(1) @binding(19) var<uniform> params: Params;

struct Params {
    vpl_count: u32,
    seed: u32,
    widest: f32,  // alpha: coats with a lobe as narrow take a ray
}

const LOBE_PAIR: u32 = 17u;      // of random numbers: the direction
const CHOICE_PAIR: u32 = 18u;    // the part of the lobe
const VPL_PAIR: u32 = 19u;
const LIGHT_PAIRS: u32 = 20u;    // first of `reflected_radiance`
// Pixels on a side of a block that shares a low-discrepancy sequence.
const BLOCK: u32 = 4u;

// Returns the radiance that a hit sends back along the ray, W/(m2 sr).
fn light_of_hit(hit: Hit, direction: vec3f, index: u32, block: u32) -> vec3f {
    let s = surface_at(hit, direction);
    if ((s.flags & UNLIT) != 0u) {
        return vec3f(0.0);
    }
    let p = path_point(s, direction);
    // Only the VPL drawn is used: nothing is removed from a ray of any length, so distance and reach do not matter.
    let vpls = vpls_at_point(p, 1.0, 1.0, sobol_2d(index, hash2(VPL_PAIR, block)));
    return reflected_radiance(p, vpls.arrival, index, hash2(LIGHT_PAIRS, block));
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (any(id.xy >= grid_size())) {
        return;
    }
    let at = load_receiver(grid_pixel(id.xy), 0.0);
    if (at.depth <= 0.0 || !at.brdf.glossy || lobe_width(at.brdf) > params.widest) {
        return;
    }
    // Draw a direction from the coat.
    let whole = whole_place(id.xy);
    let block = hash2(whole.x / BLOCK, hash2(whole.y / BLOCK, params.seed));
    let index = (sequence.index * BLOCK + whole.y % BLOCK) * BLOCK + whole.x % BLOCK;
    let frame = frame_from_normal(at.normal);
    let u = sobol_2d(index, hash2(LOBE_PAIR, block));
    let drawn = sample_brdf(coat_of(at.brdf), at.to_eye * frame, u, sobol_2d(index, hash2(CHOICE_PAIR, block)).x);
    let direction = frame * drawn.w_i;

    // Find the light along it.
    var light = vec3f(0.0);
    if (drawn.pdf > 0.0) {
        let offset = ray_offset(at.geometric_normal, pixel_terms(at.position));
        let hit = trace(Ray(offset_origin(at.position, at.geometric_normal, offset, direction), direction), FLOAT_MAX);
        if (hit.triangle != NONE) {
            light = drawn.weight * hit.tint * light_of_hit(hit, direction, index, block);
        }
    }
    glossy[id.y * grid_size().x + id.x] = vec4f(light / coat_tint(at.brdf, at.normal, at.to_eye), 1.0);
}
