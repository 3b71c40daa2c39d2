// Access to the G-buffer by pixel.
#import "scene/info.wgsl"
#import "shared/gbuffer/layers.wgsl"
#import "shared/gbuffer/distance.wgsl"

@group(1) @binding(30) var<storage, read> surfaces: array<vec4u>;

fn load_surface(pixel: vec2u) -> GbufferSurface {
    let word = (pixel.y * view.size.x + pixel.x) * gbuffer_stride();
    var s = unpack_gbuffer(surfaces[word], no_layers());
    if (HAS_LAYERS) {
        s.layers = unpack_layers(s.normal, surfaces[word + 1u], surfaces[word + 2u]);
    }
    return s;
}

// Returns the BRDF without what passes to the other side.
fn gbuffer_brdf(s: GbufferSurface) -> Brdf {
    if (HAS_COATS && (s.flags & GBUFFER_COATED) != 0u) {
        if (HAS_LAYERS) {
            var b = brdf_of(s.base_color, s.metallic, s.roughness, s.layers, s.normal, true);
            b.transmitted = vec3f(0.0);
            b.eta = 0.0;
            return b;
        }
        return brdf_metallic_roughness(s.base_color, s.metallic, s.roughness);
    }
    return brdf_lambert(s.base_color);
}
