// The VPL of light that arrives at a surface. Metals, or all coats, have a lobe; what they scatter more than once leaves like
// diffuse light, and so does what other coats reflect.
#import "scene/surface.wgsl"
#import "many_light/vpl/vpl.wgsl"
#import "common/random.wgsl"
#import "deferred/environment/reflectance.wgsl"

override METALS_ONLY: bool = false;  // coats of other materials have no lobe

// Bounds the ratio of irradiance by the shading normal to that by the geometric normal. Errs dark where light grazes a
// surface with a normal map, and bounds the brightest VPLs. tools/README.md, "Constants".
const MAX_SHADING_RATIO: f32 = 4.0;

// Returns the shading normal as a viewer in a direction drawn by the cosine sees it (`scene/facing_normal.wgsl`): the
// normals of bumps turn towards their viewer, and a VPL sends light to all. `side`: geometric normal on the lit side.
fn seen_normal(s: Surface, side: vec3f) -> vec3f {
    if (!s.bumped) {
        return s.unbent_normal;
    }
    // Mantissas alone: a scene of twice the size draws the same direction.
    let code = bitcast<vec3u>(s.position) & vec3u(0x7fffffu);
    let seed = hash2(code.x, hash2(code.y, code.z));
    let u = vec2f(unit_float(seed), unit_float(hash(seed)));
    return facing_normal(s.unbent_normal, side, frame_from_normal(side) * sample_cosine_hemisphere(u), true);
}

// Returns the VPL of a ray that carries `flux`, W, along `direction` and represents `area`, m2, of the surface it hits;
// `nearness`: inverse distance of its start, 1/m.
fn reflect_flux(s: Surface, direction: vec3f, flux: vec3f, area: f32, nearness: f32) -> Vpl {
    let normal = select(-s.geometric_normal, s.geometric_normal, s.front);
    let geometric = max(-dot(normal, direction), 1e-6);
    let shading = max(-dot(seen_normal(s, normal), direction), 0.0);
    let ratio = min(shading / geometric, MAX_SHADING_RATIO);
    let is_lit = (s.flags & UNLIT) == 0u;
    let b = surface_brdf(s);
    let arriving = select(vec3f(0.0), flux * ratio, is_lit);
    let r = reflectances_of(b, shading);
    if (HAS_LOBES && b.glossy && (!METALS_ONLY || s.metallic > 0.0)) {
        // The base's lobe sends what layers above it leave; what they reflect leaves like diffuse light.
        let share = left_for_base(b, vec3f(sqrt(1.0 - shading * shading), 0.0, shading)).mirrored * b.f90;
        return Vpl(
            s.position, normal, arriving * (r.wide + r.clearcoat), area,
            VplLobe(
                sqrt(b.alpha), arriving * share, -direction, nearness, s.unbent_normal, b.f0 / max(b.f90, 1e-6),
                arriving * r.lobe), false);
    }
    return Vpl(s.position, normal, arriving * (r.lobe + r.clearcoat + r.wide), area, no_lobe(), false);
}
