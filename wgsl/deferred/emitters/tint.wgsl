// The reflectance by which the light of emitters is divided before a blur, and multiplied after it (demodulation).
#import "common/coat.wgsl"

fn emitter_tint(brdf: Brdf, normal: vec3f, to_eye: vec3f) -> vec3f {
    let coat = select(vec3f(0.0), coat_tint(brdf, normal, to_eye), brdf.glossy);
    // Keeps the divisor above 0 on black surfaces, which reflect nothing.
    return max(brdf.diffuse * INV_PI + coat, vec3f(1e-4));
}
