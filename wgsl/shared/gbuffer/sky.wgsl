// One invocation writes the environment to those of eight pixels, one below the other, that show no surface; eight list
// their tile of 8x8 pixels if any pixel shows a surface.
//
// In: visibility, environment. Out, for pixels without a surface: an empty surface, distance 0, emission W/(m2 sr),
// with 1 in its fourth value.
#import "scene/environment.wgsl"
#import "shared/gbuffer/stride.wgsl"
#import "shared/gbuffer/tile_row.wgsl"

@group(1) @binding(11) var<storage, read_write> surfaces: array<vec4u>;
@group(1) @binding(12) var<storage, read_write> emission: array<vec4f>;
@group(1) @binding(13) var distance: texture_storage_2d<r32float, write>;
@group(1) @binding(14) var<storage, read_write> seen_tiles: array<u32>;
@group(1) @binding(15) var<storage, read_write> tile_groups: array<atomic<u32>>;
@group(1) @binding(33) var visibility: texture_2d<u32>;

const COLUMNS: u32 = 64u;  // of pixels, a workgroup's

var<workgroup> is_seen: array<atomic<u32>, COLUMNS / 8u>;  // 1: the tile shows a surface

@compute @workgroup_size(COLUMNS)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(local_invocation_index) thread: u32) {
    // WebGPU zeroes workgroup memory; wgpu-native 29 does not.
    if (thread < COLUMNS / 8u) {
        atomicStore(&is_seen[thread], 0u);
    }
    workgroupBarrier();
    var shows_surface = false;
    for (var row = 0u; row < 8u; row += 1u) {
        let pixel = vec2u(id.x, 8u * id.y + row);
        if (any(pixel >= view.size)) {
            break;
        }
        if (textureLoad(visibility, whole_pixel(pixel), 0).x > 0u) {
            shows_surface = true;
        } else {
            let index = pixel.y * view.size.x + pixel.x;
            surfaces[index * gbuffer_stride()] = vec4u(0u);
            emission[index] = vec4f(environment_radiance(pixel_ray(pixel).direction) * view.background, 1.0);
            textureStore(distance, pixel, vec4f(0.0));
        }
    }
    if (shows_surface) {
        atomicStore(&is_seen[thread / 8u], 1u);
    }
    workgroupBarrier();
    if (thread % 8u == 0u && atomicLoad(&is_seen[thread / 8u]) != 0u) {
        let slot = atomicAdd(&tile_groups[3], 1u);
        seen_tiles[slot] = id.y * ((view.size.x + 7u) / 8u) + id.x / 8u;
        atomicMax(&tile_groups[0], min(slot + 1u, TILE_ROW));
        atomicMax(&tile_groups[1], slot / TILE_ROW + 1u);
        atomicStore(&tile_groups[2], 1u);
    }
}
