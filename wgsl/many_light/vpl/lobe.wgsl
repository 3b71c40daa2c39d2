// The light that a metal's VPL sends in a direction: that of a diffuse emitter and a GGX lobe.
//
//   flux(w) = wide flux + pi F D V arriving
// The lobe is widened by the angle that the VPL's disc subtends, as a virtual spherical light is (Hasan et al. 2009,
// "Virtual Spherical Lights for Many-Light Rendering of Glossy Scenes"): a mirror's VPLs then light a surface without
// dots. Errs blurry, by less than the distance between VPLs. What the coat scatters more than once leaves like diffuse
// light.
#import "common/brdf.wgsl"
#import "many_light/vpl/vpl.wgsl"

// Share of the disc by which the lobe is widened. A metal floor of roughness 0.3 beside a wall, 96x54: with 1 the corner is
// darker (the picture's bias is -4.4 %, with 0.25 -2.4 %); at roughness 0.2 0.25 is noisier (relMSE 0.35 instead of 0.22).
const WIDENING: f32 = 0.5;
// Most that the disc adds to alpha^2: wide lobes lose the light that they scatter more than once.
const MOST_WIDENING: f32 = 0.1;

// Returns the lobe's alpha for a receiver at a distance whose inverse is `nearness`, 1/m. A mirror's D = 1 / (pi alpha^2)
// then spreads the VPL's light over its disc, as magnified from the light's mirror image.
fn widened_alpha(v: Vpl, nearness: f32) -> f32 {
    let alpha = v.lobe.roughness * v.lobe.roughness;
    let spread = nearness + v.lobe.nearness;
    return sqrt(alpha * alpha + min(WIDENING * 0.25 * INV_PI * v.area * spread * spread, MOST_WIDENING));
}

// Returns the flux, W, of the diffuse VPL that would send as much light along `way`, of any length; `reach`: squared
// distance of the receiver plus the geometry term's bound, m2.
fn flux_towards(v: Vpl, way: vec3f, reach: f32) -> vec3f {
    if (!HAS_METALS || v.lobe.roughness <= 0.0) {
        return v.flux;
    }
    let w = way * inverseSqrt(max(dot(way, way), 1e-30));
    let sum = w + v.lobe.to_light;
    let h = sum * inverseSqrt(max(dot(sum, sum), 1e-30));
    let cos_i = saturate(dot(v.lobe.normal, v.lobe.to_light));
    let cos_o = saturate(dot(v.lobe.normal, w));
    let alpha = widened_alpha(v, inverseSqrt(max(reach, 1e-30)));
    let lobe = ggx_distribution(alpha, saturate(dot(v.lobe.normal, h))) * smith_visibility(alpha, cos_i, cos_o);
    let reflected = v.lobe.arriving * fresnel_schlick(v.lobe.f0, dot(w, h)) * (PI * lobe);
    return v.flux * v.lobe.wide + select(vec3f(0.0), reflected, cos_o > 0.0);
}
