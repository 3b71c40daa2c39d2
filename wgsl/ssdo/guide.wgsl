// One invocation finds for four pixels how much each of the four pixels around them counts of a grid of every other
// pixel, and lists those that none of them stands for.
//
// In: depths and normals of the grid, G-buffer. Out: four weights of 8 bits for each pixel, 0 where there is nothing to
// light; the list.
#import "shared/gbuffer/load.wgsl"
#import "ssdo/taps.wgsl"
#import "ssdo/rest_group.wgsl"

@group(1) @binding(11) var<storage, read_write> guide: array<u32>;
@group(1) @binding(12) var<storage, read_write> rest: array<u32>;
@group(1) @binding(13) var<storage, read_write> rest_groups: array<atomic<u32>>;

// The grid stands for a pixel if the sum of its weights, 1 at best, is no less. Chosen.
const STANDS_FOR: f32 = 0.3;

fn find_weights(taps: Taps, pixel: vec2u, f: vec2f) {
    if (any(pixel >= view.size)) {
        return;
    }
    let index = pixel.y * view.size.x + pixel.x;
    let seen = load_distance(pixel);
    let surface = load_surface(pixel);
    if (seen <= 0.0 || (surface.flags & GBUFFER_UNLIT) != 0u) {
        guide[index] = 0u;
        return;
    }
    let weights = weights_of(taps, pixel, plane_depth(pixel_ray(pixel), seen), to_view(surface.normal), f);
    let sum = dot(weights, vec4f(1.0));
    guide[index] = pack4x8unorm(weights / max(sum, 1e-30));
    if (sum < STANDS_FOR) {
        let slot = atomicAdd(&rest_groups[3], 1u);
        rest[slot] = index;
        atomicMax(&rest_groups[0], min(slot / REST_GROUP + 1u, MAX_REST_GROUPS));
        atomicStore(&rest_groups[1], 1u);
        atomicStore(&rest_groups[2], 1u);
    }
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let pixel = id.xy * 2u;
    if (any(pixel >= view.size)) {
        return;
    }
    let taps = load_taps(id.xy);
    find_weights(taps, pixel, vec2f(0.0));
    find_weights(taps, pixel + vec2u(1u, 0u), vec2f(0.5, 0.0));
    find_weights(taps, pixel + vec2u(0u, 1u), vec2f(0.0, 0.5));
    find_weights(taps, pixel + 1u, vec2f(0.5));
}
