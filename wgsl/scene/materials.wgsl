// Materials and their textures, as `scene/upload_materials.py` packs them.
#import "common/brdf.wgsl"

// material flags
const DOUBLE_SIDED: u32 = 1u;
const UNLIT: u32 = 2u;
const TEXTURED: u32 = 4u; // some texture is bound, so texture coordinates are needed
const COATED: u32 = 8u;   // Lambert under a GGX coat; without it, pure Lambert

// texture flags
const PRESENT: u32 = 1u;
const TEXCOORD_1: u32 = 2u;
const NEAREST: u32 = 4u;
const WRAP_U_SHIFT: u32 = 4u;
const WRAP_V_SHIFT: u32 = 6u;
const WRAP_CLAMP: u32 = 1u;
const WRAP_MIRROR: u32 = 2u;

// A picture's place in the atlas, its sampler, and the rows of uv' = M (u, v, 1).
struct TextureSlot {
    corner: vec2u,  // texels
    size: vec2u,
    layer: u32,
    flags: u32,
    transform_u: vec3f,
    transform_v: vec3f,
}

struct Material {
    base_color: vec4f,
    emission: vec3f,       // W/(m2 sr)
    flags: u32,
    metallic: f32,
    roughness: f32,
    normal_scale: f32,
    alpha_cutoff: f32,     // 0: opaque
    emitter_pdf: f32,      // density of light samples on its triangles, 1/m2; 0: no emitter
    textures: array<TextureSlot, 4>,
}

// Slots of a material's textures.
const BASE_COLOR_SLOT: u32 = 0u;
const EMISSION_SLOT: u32 = 1u;             // the slots up to here are sRGB-coded
const METALLIC_ROUGHNESS_SLOT: u32 = 2u;
const NORMAL_SLOT: u32 = 3u;

// Compiled out where the scene has none of it.
override HAS_TEXTURES: bool = true;
override HAS_EMISSION_MAPS: bool = true;
override HAS_ROUGHNESS_MAPS: bool = true;
override HAS_NORMAL_MAPS: bool = true;
override HAS_COATS: bool = true;  // materials that are not purely Lambert

@group(1) @binding(0) var<storage, read> materials: array<Material>;
@group(1) @binding(1) var atlas_srgb: texture_2d_array<f32>;
@group(1) @binding(2) var atlas_linear: texture_2d_array<f32>;

// Returns `coordinate` brought into 0 .. size - 1.
fn wrap(coordinate: i32, size: i32, mode: u32) -> i32 {
    if (mode == WRAP_CLAMP) {
        return clamp(coordinate, 0, size - 1);
    }
    // By a quotient in floats, which CPU drivers divide much faster than integers. All values are below 2^24, so exact,
    // and the quotient's rounding may put the remainder one period off.
    let period = select(size, 2 * size, mode == WRAP_MIRROR);
    let quotient = floor(f32(coordinate) / f32(period));
    var c = i32(f32(coordinate) - quotient * f32(period));
    c = select(c, c + period, c < 0);
    c = select(c, c - period, c >= period);
    return select(c, period - 1 - c, c >= size);
}

fn load_texel(srgb: bool, x: i32, y: i32, layer: i32) -> vec4f {
    if (srgb) {
        return textureLoad(atlas_srgb, vec2i(x, y), layer, 0);
    }
    return textureLoad(atlas_linear, vec2i(x, y), layer, 0);
}

// Returns the picture in a slot, bilinear or nearest, without mip levels (aliases in the distance; unbiased under
// jitter).
fn sample_texture(material: u32, slot: u32, uv0: vec2f, uv1: vec2f) -> vec4f {
    let flags = materials[material].textures[slot].flags;
    let uv_raw = vec3f(select(uv0, uv1, (flags & TEXCOORD_1) != 0u), 1.0);
    let uv = vec2f(
        dot(materials[material].textures[slot].transform_u, uv_raw),
        dot(materials[material].textures[slot].transform_v, uv_raw));
    let size = vec2i(materials[material].textures[slot].size);
    // Coordinates beyond 2^24 texels have no fraction left; keep the integers in range.
    let nearest = (flags & NEAREST) != 0u;
    let texel = clamp(uv * vec2f(size), vec2f(-1.6e7), vec2f(1.6e7)) - select(vec2f(0.5), vec2f(0.0), nearest);
    let base = vec2i(floor(texel));
    let fraction = select(texel - floor(texel), vec2f(0.0), nearest);
    let mode = vec2u(flags >> WRAP_U_SHIFT, flags >> WRAP_V_SHIFT) & vec2u(3u);
    let corner = vec2i(materials[material].textures[slot].corner);
    let x0 = corner.x + wrap(base.x, size.x, mode.x);
    let x1 = corner.x + wrap(base.x + 1, size.x, mode.x);
    let y0 = corner.y + wrap(base.y, size.y, mode.y);
    let y1 = corner.y + wrap(base.y + 1, size.y, mode.y);
    let layer = i32(materials[material].textures[slot].layer);
    let srgb = slot <= EMISSION_SLOT;
    let top = mix(load_texel(srgb, x0, y0, layer), load_texel(srgb, x1, y0, layer), fraction.x);
    let bottom = mix(load_texel(srgb, x0, y1, layer), load_texel(srgb, x1, y1, layer), fraction.x);
    return mix(top, bottom, fraction.y);
}

fn has_texture(material: u32, slot: u32) -> bool {
    return (materials[material].textures[slot].flags & PRESENT) != 0u;
}
