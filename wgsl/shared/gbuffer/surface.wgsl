// A pixel of the G-buffer: its surface in 16 bytes, and its layers in 32 more if the scene has any.
#import "common/brdf.wgsl"
#import "shared/gbuffer/stride.wgsl"

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

// Colours are stored as square roots in 10 bits each: the error is at most 0.7 % at a base colour of 0.02.
fn pack_gbuffer(s: GbufferSurface) -> vec4u {
    let color = vec3u(round(sqrt(clamp(s.base_color, vec3f(0.0), vec3f(1.0))) * 1023.0));
    return vec4u(
        pack2x16snorm(octahedral_encode(s.normal)),
        pack2x16snorm(octahedral_encode(s.geometric_normal)),
        color.r | (color.g << 10u) | (color.b << 20u) | s.flags,
        pack2x16unorm(vec2f(s.roughness, s.metallic)));
}

fn unpack_gbuffer(texel: vec4u) -> GbufferSurface {
    let color = vec3f(vec3u(texel.z, texel.z >> 10u, texel.z >> 20u) & vec3u(1023u)) / 1023.0;
    let material = unpack2x16unorm(texel.w);
    return GbufferSurface(
        octahedral_decode(unpack2x16snorm(texel.x)), octahedral_decode(unpack2x16snorm(texel.y)),
        color * color, material.y, material.x, texel.z & (GBUFFER_COATED | GBUFFER_UNLIT), no_layers());
}
