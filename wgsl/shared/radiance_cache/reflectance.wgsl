// The reflectance of a surface, as if it were matte: what it reflects of light from all directions.
#import "scene/surface.wgsl"

fn reflectance_of(s: Surface) -> vec3f {
    let brdf = surface_brdf(s);
    if (!brdf.glossy) {
        return brdf.diffuse;
    }
    // Means over the hemisphere: the base under its coat, the lobe, and what the coat scatters more than once.
    let lobe = (20.0 * brdf.f0 + 1.0) / 21.0 * (1.0 - brdf.fit.mean_missing);
    return min(
        brdf.diffuse * brdf.fit.mean_transmitted + lobe + brdf.multiple * brdf.fit.mean_missing, vec3f(1.0));
}
