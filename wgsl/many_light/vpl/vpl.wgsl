// A virtual point light (VPL): a surface point that reflects light like a diffuse emitter (Keller 1997, "Instant
// Radiosity"); coats also have a lobe (`lobe.wgsl`), whose light photons carry (`many_light/photons`).
#import "common/math.wgsl"

override HAS_LOBES: bool = true;  // compiled out where no VPL has a lobe

struct Vpl {
    position: vec3f,  // metres relative to the scene's origin
    normal: vec3f,    // unit, geometric, on the side that it lights
    flux: vec3f,      // W, without that of the lobe: intensity in a direction w is flux / pi * max(dot(normal, w), 0)
    area: f32,        // m2, of the surface that it represents
    lobe: VplLobe,
    last: bool,       // its light has had all bounces but one: it lights pixels, but no surface that a pixel reflects
}

// A GGX lobe: what a coat scatters once.
struct VplLobe {
    roughness: f32,   // 0: no lobe
    arriving: vec3f,  // W, flux that the surface receives
    to_light: vec3f,  // unit
    nearness: f32,    // 1/m, inverse distance of the light
    normal: vec3f,    // unit, shading
    f0: vec3f,        // reflectance at normal incidence
    flux: vec3f,      // W, reflected by the lobe
}

const LAST: u32 = 0x80000000u;  // the sign of the area

// A VPL in memory: position and normal, flux and area; in scenes with lobes also the lobe.
struct PackedVpl {
    place: vec4u,
    light: vec4u,
    arriving: vec4u,
    lobe: vec4u,
}

// Returns the number of vec4u of a packed VPL.
fn vpl_words() -> u32 {
    return select(2u, 4u, HAS_LOBES);
}

fn no_lobe() -> VplLobe {
    return VplLobe(0.0, vec3f(0.0), vec3f(0.0), 0.0, vec3f(0.0), vec3f(0.0), vec3f(0.0));
}

fn unpack_vpl(p: PackedVpl) -> Vpl {
    var v = Vpl(
        bitcast<vec3f>(p.place.xyz), octahedral_decode(unpack2x16snorm(p.place.w)), bitcast<vec3f>(p.light.xyz),
        bitcast<f32>(p.light.w & ~LAST), no_lobe(), (p.light.w & LAST) != 0u);
    if (HAS_LOBES) {
        let reflectance = unpack4x8unorm(p.lobe.x);
        let arriving = bitcast<vec3f>(p.arriving.xyz);
        v.lobe = VplLobe(
            reflectance.w, arriving, octahedral_decode(unpack2x16snorm(p.arriving.w)),
            bitcast<f32>(p.lobe.w), octahedral_decode(unpack2x16snorm(p.lobe.z)), reflectance.rgb,
            arriving * unpack4x8unorm(p.lobe.y).rgb);
    }
    return v;
}

fn pack_vpl(v: Vpl) -> PackedVpl {
    var p = PackedVpl(
        vec4u(bitcast<vec3u>(v.position), pack2x16snorm(octahedral_encode(v.normal))),
        vec4u(bitcast<vec3u>(v.flux), bitcast<u32>(v.area) | select(0u, LAST, v.last)), vec4u(0u), vec4u(0u));
    if (HAS_LOBES && v.lobe.roughness > 0.0) {
        let l = v.lobe;
        p.arriving = vec4u(bitcast<vec3u>(l.arriving), pack2x16snorm(octahedral_encode(l.to_light)));
        p.lobe = vec4u(
            pack4x8unorm(vec4f(l.f0, max(l.roughness, 1.0 / 255.0))), pack4x8unorm(vec4f(l.flux / max(l.arriving, vec3f(1e-37)), 0.0)),
            pack2x16snorm(octahedral_encode(l.normal)), bitcast<u32>(l.nearness));
    }
    return p;
}

// Returns a VPL of `share` times the light and the area.
fn scale_vpl(v: Vpl, share: f32) -> Vpl {
    var scaled = v;
    scaled.flux *= share;
    scaled.area *= share;
    scaled.lobe.arriving *= share;
    scaled.lobe.flux *= share;
    return scaled;
}

// Returns the reflected flux, W, that of the lobe included.
fn total_flux(v: Vpl) -> vec3f {
    return v.flux + v.lobe.flux;
}
