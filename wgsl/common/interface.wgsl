// The interface of two media: refraction, total reflection, and what passes thin walls and volumes.
//
// eta: index of refraction beyond the interface over that on the viewer's side; 0: a thin wall, which does not refract.
#import "common/ggx.wgsl"

// Closer indices of refraction make no interface: half vectors of float32 would not resolve it.
const LEAST_CONTRAST: f32 = 0.001;

// Returns the cosine for Schlick's formula, that on the side of the thinner medium; -1: total reflection. `eta`: index of
// refraction beyond over that before; 0: a thin wall.
fn thinner_side(eta: f32, cosine: f32) -> f32 {
    if (eta <= 0.0 || eta >= 1.0) {
        return cosine;
    }
    let squared = 1.0 - max(1.0 - cosine * cosine, 0.0) / (eta * eta);
    return select(-1.0, sqrt(max(squared, 0.0)), squared > 0.0);
}

// Returns the half vector of a refraction, on w_o's side; w_o.z > 0 > w_i.z.
fn refraction_half(eta: f32, w_o: vec3f, w_i: vec3f) -> vec3f {
    let h = normalize_or(-(w_o + eta * w_i), vec3f(0.0, 0.0, 1.0));
    return select(h, -h, h.z < 0.0);
}

// Returns the direction refracted at a microfacet; zero: total reflection.
fn refracted(eta: f32, w_o: vec3f, h: vec3f) -> vec3f {
    let cosine = dot(w_o, h);
    let squared = 1.0 - max(1.0 - cosine * cosine, 0.0) / (eta * eta);
    return select(vec3f(0.0), h * (cosine / eta - sqrt(max(squared, 0.0))) - w_o / eta, squared > 0.0);
}

// Returns the share of light that passes a thin, smooth wall at an angle of that cosine. `transmission`: of the material,
// times (1 - metallic); f0, f90: of the dielectric.
fn thin_transmittance(base_color: vec3f, f0: vec3f, f90: f32, transmission: f32, cosine: f32) -> vec3f {
    return base_color * (transmission * (1.0 - fresnel_schlick_to(vec3f(max3(f0)), f90, abs(cosine)).x));
}

// Returns the share of light that a volume leaves after a way; `absorption` in 1/m.
fn volume_transmittance(absorption: vec3f, metres: f32) -> vec3f {
    return exp(-min(absorption * metres, vec3f(80.0)));
}
