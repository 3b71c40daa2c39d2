// The power heuristic's weights of the three strategies by which `path.wgsl` finds a path's last surface and its light
// (Veach 1997, eq. 9.15 and section 10.2).
//
// Densities: `light_pdf` of the light's point by N and `bsdf_pdf` by B, in 1/sr at the last surface; `own_density` of
// that surface by the path's own rays (0: the camera ray's hit) and `ray_density` by light rays, in 1/m2.

fn squared_ratio(a: f32, b: f32) -> f32 {
    // Dividing first keeps the squares in range.
    let r = a / b;
    return r * r;
}

// Returns the weight of N, next-event estimation.
fn weight_of_light(light_pdf: f32, bsdf_pdf: f32, own_density: f32, ray_density: f32) -> f32 {
    var others = select(0.0, squared_ratio(bsdf_pdf, light_pdf), light_pdf > 0.0);
    others += select(0.0, squared_ratio(ray_density, own_density), own_density > 0.0);
    return 1.0 / (1.0 + others);
}

// Returns the weight of B, a hit of the light by a ray that follows the BRDF.
fn weight_of_hit(bsdf_pdf: f32, light_pdf: f32, own_density: f32, ray_density: f32) -> f32 {
    let by_ray = select(0.0, squared_ratio(ray_density, own_density), own_density > 0.0);
    return 1.0 / (1.0 + squared_ratio(light_pdf, bsdf_pdf) * (1.0 + by_ray));
}

// Returns the weight of L, a connection with the hit of a light ray.
fn weight_of_light_ray(light_pdf: f32, bsdf_pdf: f32, own_density: f32, ray_density: f32) -> f32 {
    let by_hit = select(0.0, squared_ratio(bsdf_pdf, light_pdf), light_pdf > 0.0);
    return 1.0 / (1.0 + squared_ratio(own_density, ray_density) * (1.0 + by_hit));
}
