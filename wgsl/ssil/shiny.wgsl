// One invocation finds the light that shiny surfaces send to a pixel, by rays.
//
// E = pi / N sum_k L(y_k), directions drawn by the cosine, of hits y_k whose coat sends more in some directions than in
// others; L(y) is the light that they reflect back along the ray, of a sample of the lights by the whole BRDF
// (`deferred/hit_light.wgsl`). What such a surface sends to the camera says little about what it sends elsewhere, so SSIL
// does not gather it. Only hits that the picture shows count, with OFFSCREEN none: its rays bring that light. In:
// G-buffer, scene, whether the picture shows shiny surfaces. Out: E, W/m2, and the depth of
// `shared/denoise/plane.wgsl`; normals, packed. Errs dark by further bounces between shiny surfaces.
#import "scene/sequence.wgsl"
#import "shared/gbuffer/read.wgsl"
#import "shared/gbuffer/in_picture.wgsl"
#import "shared/denoise/plane.wgsl"
#import "deferred/hit_light.wgsl"
#import "common/matte.wgsl"
#import "common/random.wgsl"
#import "common/sampling.wgsl"

override DIRECTIONS: u32 = 1u;  // N

@group(1) @binding(11) var<storage, read_write> shiny: array<vec4f>;
@group(1) @binding(12) var<storage, read_write> normals: array<u32>;
@group(1) @binding(13) var<storage, read> shines: array<u32>;
@group(1) @binding(19) var<uniform> params: Params;

struct Params {
    seed: u32,
}

// Pairs of random numbers: the direction, and those of `reflected_radiance`.
const DIRECTION_PAIR: u32 = 11u;
const LIGHT_PAIRS: u32 = 12u;
// Pixels on a side of a block that shares a low-discrepancy sequence.
const BLOCK: u32 = 4u;

// Returns the radiance that a hit sends back along the ray, W/(m2 sr); 0 unless it is shiny and in the picture.
fn light_of_hit(hit: Hit, direction: vec3f, number: u32, block: u32) -> vec3f {
    let s = surface_at(hit, direction);
    let p = path_point(s, direction);
    if ((s.flags & UNLIT) != 0u || is_matte_brdf(surface_brdf(s)) || !is_in_picture(s.position, p.side)) {
        return vec3f(0.0);
    }
    return reflected_radiance(p, no_arrival(), number, hash2(LIGHT_PAIRS, block));
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (any(id.xy >= view.size)) {
        return;
    }
    let index = id.y * view.size.x + id.x;
    let surface = load_surface(id.xy);
    let seen = load_distance(id.xy);
    let is_lit = seen > 0.0 && (surface.flags & GBUFFER_UNLIT) == 0u && max3(gbuffer_brdf(surface).diffuse) > 0.0;
    let ray = pixel_ray(id.xy);
    var light = vec3f(0.0);
    if (is_lit && shines[0] != 0u) {
        let position = ray.origin + ray.direction * seen;
        let block = hash2(id.x / BLOCK, hash2(id.y / BLOCK, params.seed));
        let first = (sequence.index * BLOCK + id.y % BLOCK) * BLOCK + id.x % BLOCK;
        let frame = frame_from_normal(surface.normal);
        let geometric = surface.geometric_normal;
        let side = select(geometric, -geometric, dot(geometric, ray.direction) > 0.0);
        let start = position + side * ray_offset(geometric, pixel_terms(position));
        for (var k = 0u; k < DIRECTIONS; k += 1u) {
            let number = first * DIRECTIONS + k;
            let direction = frame * sample_cosine_hemisphere(sobol_2d(number, hash2(DIRECTION_PAIR, block)));
            if (dot(direction, side) <= 0.0) {
                continue;
            }
            let hit = trace(Ray(start, direction), FLOAT_MAX);
            if (hit.triangle != NONE) {
                light += hit.tint * light_of_hit(hit, direction, number, block);
            }
        }
    }
    shiny[index] = vec4f(light * (PI / f32(DIRECTIONS)), select(0.0, plane_depth(ray, seen), is_lit));
    normals[index] = pack_view_normal(surface.normal);
}
