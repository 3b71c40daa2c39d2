// One invocation finds the light that a pixel's surface transmits to the eye, by a path through rough walls and solid
// glass to the first surface that transmits none.
//
// L = T L(y), with T the product of f cos / density over the surfaces passed and exp(-sigma d) over the ways inside
// solids (`walk.wgsl`), and L(y) the light of the path's end: what the picture shows of it, or what it reflects of the
// lights and of one bounce (`end_light.wgsl`); or the environment's. In: visibility, scene, layers of the picture,
// W/(m2 sr). Out: indirect + transmitted light, W/(m2 sr). Errs dark after MOST_SURFACES and where light reaches a
// surface by caustics: shadow rays pass solids straight. Errs as `end_light.wgsl` does.
#import "shared/gbuffer/visible_surface.wgsl"
#import "deferred/transmission/end_light.wgsl"
#import "scene/sequence.wgsl"

override PATHS: u32 = 4u;

@group(1) @binding(13) var<storage, read_write> sum: array<vec4f>;
@group(1) @binding(19) var<uniform> params: Params;

struct Params {
    seed: u32,
}

// Pixels on a side of a block that shares a low-discrepancy sequence.
const BLOCK: u32 = 4u;

// Returns the mean light of the paths through a pixel's surface, W/(m2 sr).
fn transmitted(pixel: vec2u, s: Surface, direction: vec3f, distance: f32) -> vec3f {
    let block = hash2(pixel.x / BLOCK, hash2(pixel.y / BLOCK, params.seed));
    let first = (sequence.index * BLOCK + pixel.y % BLOCK) * BLOCK + pixel.x % BLOCK;
    var sum = vec3f(0.0);
    for (var k = 0u; k < PATHS; k += 1u) {
        let numbers = Numbers(first * PATHS + k, block);
        let walk = walk_through(s, direction, distance, numbers);
        var light = walk.light;
        if (walk.ends && max3(walk.throughput) > 0.0) {
            light += walk.throughput * light_of_end(walk.hit, walk.direction, walk.emission_share, numbers);
        }
        sum += select(vec3f(0.0), light, is_finite(light));
    }
    return sum / f32(PATHS);
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (any(id.xy >= view.size)) {
        return;
    }
    let index = id.y * view.size.x + id.x;
    var light = vec3f(0.0);
    if (HAS_INDIRECT) {
        light = indirect[index].rgb;
    }
    let seen = load_visibility(id.xy);
    if (seen.x != NONE) {
        let ray = pixel_ray(id.xy);
        let triangle = load_triangle(seen.x);
        let hit = hit_on_triangle(ray, triangle, seen.x, seen.y);
        let s = surface_over(triangle, hit, ray.direction, pixel_footprint(ray, triangle, hit));
        if (transmits(s) && (s.flags & UNLIT) == 0u) {
            light += transmitted(id.xy, s, ray.direction, hit.distance);
        }
    }
    sum[index] = vec4f(light, 1.0);
}
