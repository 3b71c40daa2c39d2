// One invocation prepares a pixel of the first level for the denoiser: its irradiance with the depth of
// `shared/denoise/plane.wgsl`, and its normal.
//
// A surfel can lie anywhere in its pixel's square of the picture, but the denoiser takes depths along the ray of the
// square's first pixel: the depth is that of the surfel's plane there, which keeps planes plane. In: surfels;
// irradiance, W/m2. Out: (r, g, b, depth), depth 0 without a surface; normals.
#import "ssil/surfel.wgsl"
#import "shared/denoise/plane.wgsl"

override STRIDE: u32 = 2u;  // picture pixels per side of a pixel of the level

@group(1) @binding(11) var surfels: texture_storage_2d<rgba32uint, read>;
@group(1) @binding(12) var<storage, read> irradiance: array<vec4f>;
@group(1) @binding(13) var<storage, read_write> light: array<vec4f>;
@group(1) @binding(14) var<storage, read_write> normals: array<u32>;

// Planes seen at a lower cosine than this have the surfel's own depth, which is then nearer than the plane's.
const LEAST_COSINE: f32 = 0.05;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(surfels);
    if (any(id.xy >= size)) {
        return;
    }
    let index = id.y * size.x + id.x;
    let texel = textureLoad(surfels, id.xy);
    if (is_empty(texel)) {
        light[index] = vec4f(0.0);
        normals[index] = 0u;
        return;
    }
    let normal = surfel_normal(texel);
    let ray = pixel_ray(min(id.xy * STRIDE, view.size - 1u));
    let way = surfel_position(texel) - (ray.origin - view.position);
    let cosine = dot(normal, ray.direction);
    let along = select(dot(way, ray.direction), dot(way, normal) / cosine, cosine < -LEAST_COSINE);
    let depth = plane_depth(ray, max(along, 1e-6 * length(way)));
    light[index] = vec4f(irradiance[index].rgb, depth);
    normals[index] = pack_view_normal(normal);
}
