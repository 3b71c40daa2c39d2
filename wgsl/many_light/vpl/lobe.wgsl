// The GGX lobe of a VPL. Gathering takes the part of it that is no brighter than a diffuse VPL of reflectance MOST_GATHERED;
// photons take the rest, which would make dots (luminance decides):
//
//   flux(w) = diffuse flux + arriving min(pi F D V, MOST_GATHERED),  photons: arriving max(pi F D V - MOST_GATHERED, 0) / pi
// Hits of reflections take the whole lobe, widened by the angle that the VPL's disc subtends, as a virtual spherical light is
// (Hasan et al. 2009, "Virtual Spherical Lights for Many-Light Rendering of Glossy Scenes"). It errs blurry, by less than the
// distance between VPLs; all else is exact.
#import "common/ggx.wgsl"
#import "many_light/vpl/vpl.wgsl"

// Reflectance of the diffuse VPL that is as bright as the brightest part of a lobe that is gathered.
const MOST_GATHERED: f32 = 1.5;
// Share of the disc by which the lobe is widened: a half is less noisy than a quarter, and loses less than all.
const WIDENING: f32 = 0.5;
// Most that the disc adds to alpha^2: wide lobes lose the light that they scatter more than once.
const MOST_WIDENING: f32 = 0.1;

// The direction in which a path leaves a vertex.
struct Sent {
    direction: vec3f,
    flux: vec3f,       // W, over the density of the direction
}

// Draws a direction from the lobe.
fn send_by_lobe(v: Vpl, u: vec2f) -> Sent {
    let alpha = max(v.lobe.roughness * v.lobe.roughness, MIN_ALPHA);
    let frame = frame_from_normal(v.lobe.normal);
    let w_o = v.lobe.to_light * frame;
    let w_i = reflect(-w_o, sample_visible_normal(vec2f(alpha), w_o, u));
    let direction = frame * w_i;
    let h = normalize(w_i + w_o);
    let f = fresnel_schlick(v.lobe.f0, dot(w_i, h))
        * (ggx_distribution(alpha, h.z) * smith_visibility(alpha, w_i.z, w_o.z));
    let pdf = ggx_pdf(alpha, h.z, w_o.z);
    // Light, unlike importance, leaves by the cosine with the geometric normal (Veach 1997, section 5.3.2).
    let cosine = dot(v.normal, direction);
    if (cosine <= 0.0 || w_i.z <= 0.0 || w_o.z <= 0.0 || pdf <= 0.0) {
        return Sent(direction, vec3f(0.0));
    }
    return Sent(direction, v.lobe.arriving * (f * (w_i.z / pdf)) * (cosine / max(w_i.z, 1e-6)));
}

// Returns the lobe's alpha for a receiver at a distance whose inverse is `nearness`, 1/m. A mirror's D = 1 / (pi alpha^2)
// then spreads the VPL's light over its disc, as magnified from the light's mirror image.
fn widened_alpha(v: Vpl, nearness: f32) -> f32 {
    let alpha = v.lobe.roughness * v.lobe.roughness;
    let spread = nearness + v.lobe.nearness;
    return sqrt(alpha * alpha + min(WIDENING * 0.25 * INV_PI * v.area * spread * spread, MOST_WIDENING));
}

// Returns pi D V of a direction, unit; `alpha`: of the lobe.
fn lobe_towards(v: Vpl, w: vec3f, alpha: f32) -> f32 {
    let sum = w + v.lobe.to_light;
    let h = sum * inverseSqrt(max(dot(sum, sum), 1e-30));
    let cos_i = saturate(dot(v.lobe.normal, v.lobe.to_light));
    let cos_o = dot(v.lobe.normal, w);
    let lobe = ggx_distribution(alpha, saturate(dot(v.lobe.normal, h))) * smith_visibility(alpha, cos_i, saturate(cos_o));
    return select(0.0, PI * lobe, cos_o > 0.0);
}

// Returns the Fresnel term of a direction, unit.
fn lobe_fresnel(v: Vpl, w: vec3f) -> vec3f {
    let sum = w + v.lobe.to_light;
    return fresnel_schlick(v.lobe.f0, dot(w, sum) * inverseSqrt(max(dot(sum, sum), 1e-30)));
}

// Returns the flux, W, of the diffuse VPL that would send as much gathered light along `way`, of any length.
fn flux_towards(v: Vpl, way: vec3f) -> vec3f {
    if (!HAS_LOBES || v.lobe.roughness <= 0.0) {
        return v.flux;
    }
    let w = way * inverseSqrt(max(dot(way, way), 1e-30));
    let reflected = lobe_fresnel(v, w) * lobe_towards(v, w, v.lobe.roughness * v.lobe.roughness);
    return v.flux + v.lobe.arriving * reflected * min(MOST_GATHERED / max(luminance(reflected), 1e-30), 1.0);
}

// Returns the flux, W, of the diffuse VPL that would send as much light along `way`, of any length, with the widened lobe;
// `reach`: squared distance of the receiver plus the geometry term's bound, m2.
fn widened_flux_towards(v: Vpl, way: vec3f, reach: f32) -> vec3f {
    if (!HAS_LOBES || v.lobe.roughness <= 0.0) {
        return v.flux;
    }
    let w = way * inverseSqrt(max(dot(way, way), 1e-30));
    let lobe = lobe_towards(v, w, widened_alpha(v, inverseSqrt(max(reach, 1e-30))));
    return v.flux + v.lobe.arriving * lobe_fresnel(v, w) * lobe;
}

// Returns the share of a lobe's light in a direction, unit, that photons carry.
fn photon_share(v: Vpl, w: vec3f) -> f32 {
    let reflected = lobe_fresnel(v, w) * lobe_towards(v, w, v.lobe.roughness * v.lobe.roughness);
    return max(1.0 - MOST_GATHERED / max(luminance(reflected), 1e-30), 0.0);
}

// Returns about the share of a lobe's light in all directions that photons carry, above 0: at normal incidence, pi F D V is
// above MOST_GATHERED within half vectors of sin^2 + alpha^2 cos^2 = alpha / (2 sqrt(MOST_GATHERED / F)).
fn mean_photon_share(v: Vpl) -> f32 {
    let fresnel = luminance(fresnel_schlick(v.lobe.f0, saturate(dot(v.lobe.normal, v.lobe.to_light))));
    let most = MOST_GATHERED / max(fresnel, 1e-6);
    return max(1.0 - 2.0 * sqrt(most) * v.lobe.roughness * v.lobe.roughness, 0.05);
}
