// A virtual point light (VPL): a surface point that reflects light like a diffuse emitter (Keller 1997, "Instant
// Radiosity").
#import "common/math.wgsl"

struct Vpl {
    position: vec3f,  // metres relative to the scene's origin
    normal: vec3f,    // unit, geometric, on the side that it lights
    flux: vec3f,      // W; intensity in a direction w is flux / pi * max(dot(normal, w), 0)
    area: f32,        // m2, of the surface that it represents
}

// A VPL is two vec4u: position and normal, flux and area.
fn unpack_vpl(a: vec4u, b: vec4u) -> Vpl {
    return Vpl(
        bitcast<vec3f>(a.xyz), octahedral_decode(unpack2x16snorm(a.w)), bitcast<vec3f>(b.xyz), bitcast<f32>(b.w));
}

fn pack_vpl_place(v: Vpl) -> vec4u {
    return vec4u(bitcast<vec3u>(v.position), pack2x16snorm(octahedral_encode(v.normal)));
}

fn pack_vpl_light(v: Vpl) -> vec4u {
    return vec4u(bitcast<vec3u>(v.flux), bitcast<u32>(v.area));
}
