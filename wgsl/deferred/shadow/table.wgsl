// The table of lights and of their shadow views' lookups, in a texture.
//
// The table is a read-only storage texture: loads limit these passes, and CPU drivers load a texel of 16 bytes as fast
// as one word of a buffer.
#import "deferred/shadow/views.wgsl"

// Texels in rows of LIGHT_TABLE_WIDTH: a header, whose x is the number of lights, 5 for each light, 5 for each view.
@group(1) @binding(25) var light_table: texture_storage_2d<rgba32uint, read>;

const LIGHT_TABLE_WIDTH: u32 = 4096u;

fn light_texel(index: u32) -> vec4u {
    return textureLoad(light_table, vec2u(index % LIGHT_TABLE_WIDTH, index / LIGHT_TABLE_WIDTH));
}

fn load_light_count() -> u32 {
    return light_texel(0u).x;
}

fn load_light(number: u32) -> DirectLight {
    let a = light_texel(5u * number + 1u);
    let b = light_texel(5u * number + 2u);
    let c = light_texel(5u * number + 3u);
    let d = light_texel(5u * number + 4u);
    let e = light_texel(5u * number + 5u);
    return DirectLight(
        bitcast<vec3f>(a.xyz), a.w, bitcast<vec3f>(b.xyz), bitcast<f32>(b.w), bitcast<vec3f>(c.xyz), bitcast<f32>(c.w),
        bitcast<f32>(d.x), bitcast<f32>(d.y), d.z, d.w, e.x);
}

fn load_view(number: u32, light_count: u32) -> ShadowLookup {
    let first = 5u * (light_count + number) + 1u;
    let a = bitcast<vec4f>(light_texel(first));
    let b = bitcast<vec4f>(light_texel(first + 1u));
    let c = bitcast<vec4f>(light_texel(first + 2u));
    let d = bitcast<vec4f>(light_texel(first + 3u));
    let e = bitcast<vec4f>(light_texel(first + 4u));
    return ShadowLookup(a.xyz, a.w, b.xyz, b.w, c.xyz, c.w, d.xy, d.zw, e.xy);
}
