// One invocation finds how much of the environment's light a pixel's surface gets: the share that reaches it of what
// would, V = sum_k L(w_k) V(w_k) / sum_k L(w_k), by rays about the normal in proportion to the cosine.
//
// Pixels of an n x n square share a stratified set of directions among them; the blur that follows averages over such
// squares. In: G-buffer, scene. Out: V per channel, 0 to 1, and the depth of `denoise/plane.wgsl`, 0 where there is
// nothing to light. A ratio, so free of noise where nothing or all is hidden; errs where one bright spot of a pictured
// environment carries most of the light.
#import "scene/sequence.wgsl"
#import "gbuffer/seen.wgsl"
#import "gbuffer/read.wgsl"
#import "environment/picture.wgsl"
#import "gbuffer/tiles.wgsl"
#import "common/random.wgsl"
#import "denoise/plane.wgsl"

@group(1) @binding(11) var<storage, read_write> occlusion: array<vec4f>;
@group(1) @binding(12) var<storage, read_write> normals: array<u32>;
@group(1) @binding(19) var<uniform> params: Params;

struct Params {
    seed: u32,
}

override RAYS: u32 = 1u;        // for each pixel
override INTERLEAVE: u32 = 4u;  // n

// Has no common divisor with the square of INTERLEAVE.
const CLASS_STEP: u32 = 11u;

@compute @workgroup_size(8, 8)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) thread: vec3u) {
    let pixel = pixel_of_tile(group, thread, view.size);
    if (any(pixel >= view.size)) {
        return;
    }
    let index = pixel.y * view.size.x + pixel.x;
    let seen = load_visibility(pixel);
    let surface = load_surface(pixel);
    if (seen.x == NONE || (surface.flags & GBUFFER_UNLIT) != 0u) {
        return;
    }
    let ray = pixel_ray(pixel);
    let distance_seen = load_distance(pixel);
    let position = ray.origin + ray.direction * distance_seen;
    let front = dot(surface.geometric_normal, ray.direction) < 0.0;
    let side = select(-surface.geometric_normal, surface.geometric_normal, front);
    let reach = max3(abs(scene.centre)) + scene.radius + distance_seen;
    let start = position + side * (POSITION_ULPS * reach);
    let frame = frame_from_normal(surface.normal);
    // Going round from frame to frame, so that in the mean each pixel has all directions.
    let own = (pixel.y % INTERLEAVE) * INTERLEAVE + pixel.x % INTERLEAVE;
    let class_number = (own + sequence.index * CLASS_STEP) % (INTERLEAVE * INTERLEAVE);
    let first = (sequence.index * INTERLEAVE * INTERLEAVE + class_number) * RAYS;
    var arriving = vec3f(0.0);
    var sent = vec3f(0.0);
    for (var k = 0u; k < RAYS; k += 1u) {
        let direction = frame * sample_cosine_hemisphere(sobol_2d(first + k, params.seed));
        let radiance = environment_radiance(direction);
        sent += radiance;
        // Below the surface itself there is nothing to see.
        if (dot(direction, side) > 0.0) {
            let way = Ray(start, direction);
            let found = trace_all(Rays(way, FLOAT_MAX, way, 0.0, way, 0.0));
            arriving += select(radiance, vec3f(0.0), found.occluded_a);
        }
    }
    let shares = select(arriving / max(sent, vec3f(1e-37)), vec3f(0.0), sent <= vec3f(0.0));
    occlusion[index] = vec4f(shares, plane_depth(ray, distance_seen));
    normals[index] = pack_view_normal(surface.normal);
}
