// One invocation finds the light that a pixel's coat reflects, by rays along directions drawn from the coat.
//
// L / tint = 1 / N sum_k f_r cos / density L(y_k) / tint, with the hits y_k and L(y) the light that they reflect back
// along the ray: of a sample of the lights by the whole BRDF (`deferred/hit_light.wgsl`), with HAS_BEFORE + rho E / pi.
// Only hits that the picture shows count, with OFFSCREEN all. In: G-buffer, scene; irradiance E of the bounces before,
// of each pixel of the picture, W/m2. Out: L over `coat_tint`, W/(m2 sr), and the depth of `shared/denoise/plane.wgsl`, 0
// without a coat; normals, packed. Errs dark in mirrors of mirrors: E is what hits reflect by their base.
#import "scene/sequence.wgsl"
#import "shared/gbuffer/read.wgsl"
#import "shared/gbuffer/in_picture.wgsl"
#import "shared/denoise/plane.wgsl"
#import "deferred/hit_light.wgsl"
#import "common/coat.wgsl"
#import "common/random.wgsl"

override DIRECTIONS: u32 = 1u;  // N
override HAS_BEFORE: bool = false;
override OFFSCREEN: bool = false;

@group(1) @binding(11) var<storage, read_write> glossy: array<vec4f>;
@group(1) @binding(12) var<storage, read_write> normals: array<u32>;
@group(1) @binding(13) var<storage, read> before: array<vec4f>;
@group(1) @binding(19) var<uniform> params: Params;

struct Params {
    seed: u32,
}

// Pairs of random numbers: the direction, the part of the lobe, and those of `reflected_radiance`.
const LOBE_PAIR: u32 = 1u;
const CHOICE_PAIR: u32 = 2u;
const LIGHT_PAIRS: u32 = 3u;
// Pixels on a side of a block that shares a low-discrepancy sequence.
const BLOCK: u32 = 4u;

// Returns the radiance that a hit sends back along the ray, W/(m2 sr).
fn light_of_hit(hit: Hit, direction: vec3f, number: u32, block: u32) -> vec3f {
    let s = surface_at(hit, direction);
    let p = path_point(s, direction);
    let shown = is_in_picture(s.position, p.side);
    if ((s.flags & UNLIT) != 0u || !(shown || OFFSCREEN)) {
        return vec3f(0.0);
    }
    var light = reflected_radiance(p, no_arrival(), number, hash2(LIGHT_PAIRS, block));
    if (HAS_BEFORE && shown) {
        let pixel = pixel_in_picture(s.position);
        light += before[pixel.y * view.size.x + pixel.x].rgb * p.brdf.diffuse * INV_PI;
    }
    return light;
}

// Returns the mean light of a pixel's directions. `offset`: of rays that leave the surface, metres.
fn reflected(pixel: vec2u, surface: GbufferSurface, coat: Brdf, ray: Ray, position: vec3f, offset: f32) -> vec3f {
    let block = hash2(pixel.x / BLOCK, hash2(pixel.y / BLOCK, params.seed));
    let first = (sequence.index * BLOCK + pixel.y % BLOCK) * BLOCK + pixel.x % BLOCK;
    let frame = frame_from_normal(surface.normal);
    let geometric = surface.geometric_normal;
    let side = select(geometric, -geometric, dot(geometric, ray.direction) > 0.0);
    var sum = vec3f(0.0);
    for (var k = 0u; k < DIRECTIONS; k += 1u) {
        // Draw a direction from the coat.
        let number = first * DIRECTIONS + k;
        let u = sobol_2d(number, hash2(LOBE_PAIR, block));
        let drawn = sample_brdf(coat, -ray.direction * frame, u, sobol_2d(number, hash2(CHOICE_PAIR, block)).x);
        let direction = frame * drawn.w_i;
        if (drawn.pdf <= 0.0 || dot(direction, side) <= 0.0) {
            continue;
        }
        // Find the light along it.
        let hit = trace(Ray(position + side * offset, direction), FLOAT_MAX);
        if (hit.triangle != NONE) {
            sum += drawn.weight * hit.tint * light_of_hit(hit, direction, number, block);
        }
    }
    return sum / f32(DIRECTIONS);
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (any(id.xy >= view.size)) {
        return;
    }
    let index = id.y * view.size.x + id.x;
    let surface = load_surface(id.xy);
    let seen = load_distance(id.xy);
    let brdf = gbuffer_brdf(surface);
    glossy[index] = vec4f(0.0);
    normals[index] = 0u;
    if (seen <= 0.0 || (surface.flags & GBUFFER_UNLIT) != 0u || !brdf.glossy) {
        return;
    }
    let ray = pixel_ray(id.xy);
    let position = ray.origin + ray.direction * seen;
    let offset = ray_offset(surface.geometric_normal, pixel_terms(position));
    let light = reflected(id.xy, surface, coat_of(brdf), ray, position, offset);
    glossy[index] = vec4f(light / coat_tint(brdf, surface.normal, -ray.direction), plane_depth(ray, seen));
    normals[index] = pack_view_normal(surface.normal);
}
