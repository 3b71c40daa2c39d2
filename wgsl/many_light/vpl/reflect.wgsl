// What arrives at a surface and leaves it as the light of a virtual point light: what coats reflect, too, counts as
// diffuse (errs: no caustics).
#import "scene/surface.wgsl"
#import "many_light/vpl/vpl.wgsl"
#import "deferred/environment/reflectance.wgsl"

// How much more light than by its geometric normal a surface may get by its shading normal. Chosen: bounds the brightest
// lights; errs dark where light grazes what is finely shaded.
const MAX_SHADING_RATIO: f32 = 4.0;

// Returns the light that a surface reflects of a ray's flux, W. `density` is that of such rays where it hits, 1/m2.
fn reflect_flux(s: Surface, direction: vec3f, flux: vec3f, area: f32) -> Vpl {
    let normal = select(-s.geometric_normal, s.geometric_normal, s.front);
    let geometric = max(-dot(normal, direction), 1e-6);
    let shading = max(-dot(s.normal, direction), 0.0);
    let ratio = min(shading / geometric, MAX_SHADING_RATIO);
    let is_lit = (s.flags & UNLIT) == 0u;
    let reflected = flux * directional_reflectance(surface_brdf(s), shading) * ratio;
    return Vpl(s.position, normal, select(vec3f(0.0), reflected, is_lit), area);
}
