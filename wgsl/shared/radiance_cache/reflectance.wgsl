// The reflectance of a surface, as if it were matte: what it reflects of light from all directions.
#import "scene/surface.wgsl"
#import "common/lobes.wgsl"

fn reflectance_of(s: Surface) -> vec3f {
    let brdf = surface_brdf(s);
    if (!brdf.glossy) {
        return brdf.diffuse;
    }
    // Means over the hemisphere: the base under its coat, the lobe, and what the coat scatters more than once.
    let lobe = (20.0 * brdf.f0 + brdf.f90) / 21.0 * (1.0 - brdf.fit.mean_missing);
    let base = brdf.diffuse * brdf.fit.mean_transmitted + lobe + brdf.multiple * brdf.fit.mean_missing;
    if (HAS_CLEARCOAT || HAS_SHEEN) {
        // Layers above it, at the cosine 2 / 3, the mean of light from all directions.
        let w = vec3f(sqrt(5.0) / 3.0, 0.0, 2.0 / 3.0);
        let coat = left_by_clearcoat(brdf, w).scattered;
        let sheen = sheen_reflectance(brdf, w.z) + left_by_sheen(brdf, w.z).scattered * base;
        return min(1.0 - coat + coat * sheen, vec3f(1.0));
    }
    return min(base, vec3f(1.0));
}
