// The VPL of light that arrives at a surface. All reflected light leaves as diffuse, so there are no caustics.
#import "scene/surface.wgsl"
#import "many_light/vpl/vpl.wgsl"
#import "deferred/environment/reflectance.wgsl"

// Bounds the ratio of irradiance by the shading normal to that by the geometric normal. Errs dark where light grazes a
// surface with a normal map, and bounds the brightest VPLs. tools/README.md, "Constants".
const MAX_SHADING_RATIO: f32 = 4.0;

// Returns the VPL of a ray that carries `flux`, W, along `direction` and represents `area`, m2, of the surface it hits.
fn reflect_flux(s: Surface, direction: vec3f, flux: vec3f, area: f32) -> Vpl {
    let normal = select(-s.geometric_normal, s.geometric_normal, s.front);
    let geometric = max(-dot(normal, direction), 1e-6);
    let shading = max(-dot(s.normal, direction), 0.0);
    let ratio = min(shading / geometric, MAX_SHADING_RATIO);
    let is_lit = (s.flags & UNLIT) == 0u;
    let reflected = flux * directional_reflectance(surface_brdf(s), shading) * ratio;
    return Vpl(s.position, normal, select(vec3f(0.0), reflected, is_lit), area);
}
