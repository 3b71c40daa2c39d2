// One invocation resolves a pixel of the visibility buffer: the triangle's surface at the point that the path tracer's
// ray hits, with textures averaged over the pixel's footprint (`scene/footprint.wgsl`).
//
// In: visibility. Out: the packed surface; distance along the pixel's ray in metres, 0 where nothing is seen; emission,
// the surface's radiance towards the eye, W/(m2 sr), with 0 in its fourth value. Pixels without a surface are not written.
#import "shared/gbuffer/tiles.wgsl"
#import "shared/gbuffer/visible_surface.wgsl"
#import "shared/gbuffer/layers.wgsl"

@group(1) @binding(11) var<storage, read_write> surfaces: array<vec4u>;
@group(1) @binding(12) var<storage, read_write> emission: array<vec4f>;
@group(1) @binding(13) var distance: texture_storage_2d<r32float, write>;

// True: some surface is emissive or unlit. False: emission keeps its cleared value.
override HAS_EMISSION: bool = true;

@compute @workgroup_size(8, 8)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) thread: vec3u) {
    let pixel = pixel_of_tile(group, thread, view.size);
    if (any(pixel >= view.size)) {
        return;
    }
    let seen = load_visibility(pixel);
    if (seen.x == NONE) {
        return;
    }
    let index = pixel.y * view.size.x + pixel.x;
    let ray = pixel_ray(pixel);
    let triangle = load_triangle(seen.x);
    let hit = hit_on_triangle(ray, triangle, seen.x, seen.y);
    let s = surface_over(triangle, hit, ray.direction, pixel_footprint(ray, triangle, hit));
    let unlit = HAS_EMISSION && (s.flags & UNLIT) != 0u;
    let flags = select(0u, GBUFFER_UNLIT, unlit) | select(0u, GBUFFER_COATED, HAS_COATS && (s.flags & COATED) != 0u);
    surfaces[index * gbuffer_stride()] = pack_gbuffer(
        GbufferSurface(s.normal, s.geometric_normal, s.base_color, s.metallic, s.roughness, flags, s.layers));
    if (HAS_LAYERS) {
        surfaces[index * gbuffer_stride() + 1u] = pack_coats(s.layers);
        surfaces[index * gbuffer_stride() + 2u] = pack_lobes(s.layers, s.normal);
    }
    if (HAS_EMISSION) {
        emission[index] = vec4f(select(s.emission, s.base_color, unlit), 0.0);
    }
    // Keep it above 0, which means no surface.
    textureStore(distance, pixel, vec4f(max(hit.distance, 1e-37)));
}
