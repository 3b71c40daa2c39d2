// One invocation turns the triangle that a pixel shows into its surface, as the path tracer sees it.
//
// In: visibility. Out: the packed surface; distance along the pixel's ray in metres, 0 where nothing is seen; emission,
// the radiance in W/(m2 sr) that the surface or the environment behind it shines towards the eye.
#import "environment/picture.wgsl"
#import "gbuffer/seen.wgsl"
#import "gbuffer/surface.wgsl"

@group(1) @binding(11) var<storage, read_write> surfaces: array<vec4u>;
@group(1) @binding(12) var<storage, read_write> emission: array<vec4f>;
@group(1) @binding(13) var distance: texture_storage_2d<r32float, write>;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let pixel = id.xy;
    if (any(pixel >= view.size)) {
        return;
    }
    let index = pixel.y * view.size.x + pixel.x;
    let ray = pixel_ray(pixel);
    let seen = load_visibility(pixel);
    if (seen.x == NONE) {
        surfaces[index] = vec4u(0u);
        emission[index] = vec4f(environment_radiance(ray.direction), 1.0);
        textureStore(distance, pixel, vec4f(0.0));
        return;
    }
    let hit = hit_on_triangle(ray, seen.x, seen.y);
    let s = surface_at(hit, ray.direction);
    let unlit = (s.flags & UNLIT) != 0u;
    let flags = select(0u, GBUFFER_UNLIT, unlit) | select(0u, GBUFFER_COATED, HAS_COATS && (s.flags & COATED) != 0u);
    surfaces[index] = pack_gbuffer(
        GbufferSurface(s.normal, s.geometric_normal, s.base_color, s.metallic, s.roughness, flags));
    emission[index] = vec4f(select(s.emission, s.base_color, unlit), 1.0);
    // Above 0, which says that nothing is seen.
    textureStore(distance, pixel, vec4f(max(hit.distance, 1e-37)));
}
