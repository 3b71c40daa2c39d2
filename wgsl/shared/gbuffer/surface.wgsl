// A pixel of the G-buffer: its surface in 16 bytes, and its layers in 32 more if the scene has any.
#import "common/brdf.wgsl"
#import "common/layers.wgsl"

// flags, above the base colour
const GBUFFER_COATED: u32 = 0x40000000u;  // Lambert under a GGX coat, else pure Lambert
const GBUFFER_UNLIT: u32 = 0x80000000u;   // KHR_materials_unlit: neither lit nor reflecting

struct GbufferSurface {
    normal: vec3f,            // unit, shading, towards the viewer
    geometric_normal: vec3f,  // unit, on the counter-clockwise side
    base_color: vec3f,
    metallic: f32,
    roughness: f32,
    flags: u32,
    layers: Layers,
}

// Returns the code of a colour: square roots in 10 bits each. The error is at most 0.7 % at a reflectance of 0.02.
fn color_code(reflectance: vec3f) -> u32 {
    let code = vec3u(round(sqrt(clamp(reflectance, vec3f(0.0), vec3f(1.0))) * 1023.0));
    return code.r | (code.g << 10u) | (code.b << 20u);
}

fn color_of_code(code: u32) -> vec3f {
    let root = vec3f(vec3u(code, code >> 10u, code >> 20u) & vec3u(1023u)) / 1023.0;
    return root * root;
}

fn pack_gbuffer(s: GbufferSurface) -> vec4u {
    return vec4u(
        pack2x16snorm(octahedral_encode(s.normal)),
        pack2x16snorm(octahedral_encode(s.geometric_normal)),
        color_code(s.base_color) | s.flags,
        pack2x16unorm(vec2f(s.roughness, s.metallic)));
}

// `layers`: of `shared/gbuffer/layers.wgsl`.
fn unpack_gbuffer(texel: vec4u, layers: Layers) -> GbufferSurface {
    let material = unpack2x16unorm(texel.w);
    return GbufferSurface(
        octahedral_decode(unpack2x16snorm(texel.x)), octahedral_decode(unpack2x16snorm(texel.y)),
        color_of_code(texel.z), material.y, material.x, texel.z & (GBUFFER_COATED | GBUFFER_UNLIT), layers);
}
