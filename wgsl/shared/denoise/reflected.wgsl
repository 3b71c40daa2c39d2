// The radiance that a pixel reflects of filtered light.
#import "shared/gbuffer/load.wgsl"
#import "common/coat.wgsl"

// Returns W/(m2 sr); `coat`: the coat's light over its tint.
fn reflected(pixel: vec2u, irradiance: vec3f, coat: vec3f) -> vec3f {
    let surface = load_surface(pixel);
    let brdf = gbuffer_brdf(surface);
    var radiance = irradiance * brdf.diffuse * INV_PI;
    if (HAS_COATS) {
        radiance += coat * coat_tint(brdf, surface.normal, -pixel_ray(pixel).direction);
    }
    return radiance;
}
