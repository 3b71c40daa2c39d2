// One invocation writes the environment to a pixel that shows no surface; one workgroup lists its tile of 8x8 pixels if
// any pixel shows a surface.
//
// In: visibility, environment. Out, for pixels without a surface: an empty surface, distance 0, emission W/(m2 sr),
// with 1 in its fourth value.
#import "scene/environment.wgsl"
#import "shared/gbuffer/tile_row.wgsl"

@group(1) @binding(11) var<storage, read_write> surfaces: array<vec4u>;
@group(1) @binding(12) var<storage, read_write> emission: array<vec4f>;
@group(1) @binding(13) var distance: texture_storage_2d<r32float, write>;
@group(1) @binding(14) var<storage, read_write> seen_tiles: array<u32>;
@group(1) @binding(15) var<storage, read_write> tile_groups: array<atomic<u32>>;
@group(1) @binding(33) var visibility: texture_2d<u32>;

var<workgroup> is_seen: atomic<u32>;

@compute @workgroup_size(8, 8)
fn main(
    @builtin(global_invocation_id) id: vec3u, @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) thread: u32
) {
    let pixel = id.xy;
    // WebGPU zeroes workgroup memory; wgpu-native 29 does not.
    if (thread == 0u) {
        atomicStore(&is_seen, 0u);
    }
    workgroupBarrier();
    if (all(pixel < view.size)) {
        if (textureLoad(visibility, pixel, 0).x > 0u) {
            atomicStore(&is_seen, 1u);
        } else {
            let index = pixel.y * view.size.x + pixel.x;
            surfaces[index] = vec4u(0u);
            emission[index] = vec4f(environment_radiance(pixel_ray(pixel).direction) * view.background, 1.0);
            textureStore(distance, pixel, vec4f(0.0));
        }
    }
    workgroupBarrier();
    if (thread == 0u && atomicLoad(&is_seen) != 0u) {
        let slot = atomicAdd(&tile_groups[3], 1u);
        seen_tiles[slot] = group.y * groups.x + group.x;
        atomicMax(&tile_groups[0], min(slot + 1u, TILE_ROW));
        atomicMax(&tile_groups[1], slot / TILE_ROW + 1u);
        atomicStore(&tile_groups[2], 1u);
    }
}
