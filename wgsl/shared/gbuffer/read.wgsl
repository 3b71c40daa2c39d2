// Access to the G-buffer by pixel.
#import "scene/info.wgsl"
#import "shared/gbuffer/surface.wgsl"

@group(1) @binding(30) var<storage, read> surfaces: array<vec4u>;
@group(1) @binding(31) var distance: texture_2d<f32>;  // metres along the pixel's ray, 0: nothing there

fn load_distance(pixel: vec2u) -> f32 {
    return textureLoad(distance, pixel, 0).r;
}

fn load_surface(pixel: vec2u) -> GbufferSurface {
    return unpack_gbuffer(surfaces[pixel.y * view.size.x + pixel.x]);
}

fn gbuffer_brdf(s: GbufferSurface) -> Brdf {
    if (HAS_COATS && (s.flags & GBUFFER_COATED) != 0u) {
        return brdf_metallic_roughness(s.base_color, s.metallic, s.roughness);
    }
    return brdf_lambert(s.base_color);
}
