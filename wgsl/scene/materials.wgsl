// Materials and their textures, as `upload/materials.py` packs them.
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
const SIXTEEN_BITS: u32 = 8u;  // of each channel: the low bytes lie `size.y` texels below the high ones
const WRAP_U_SHIFT: u32 = 4u;
const WRAP_V_SHIFT: u32 = 6u;
const WRAP_CLAMP: u32 = 1u;
const WRAP_MIRROR: u32 = 2u;

// An image's place in the atlas, its sampler, and the rows of uv' = M (u, v, 1).
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
    emitter_pdf: f32,      // density of light samples where it emits all of `emission`, 1/m2; 0: no emitter
    textures: array<TextureSlot, 4>,
}

// Slots of a material's textures.
const BASE_COLOR_SLOT: u32 = 0u;
const EMISSION_SLOT: u32 = 1u;             // the slots up to here are sRGB-coded
const METALLIC_ROUGHNESS_SLOT: u32 = 2u;
const NORMAL_SLOT: u32 = 3u;

// Each is compiled out if the scene has none.
override HAS_TEXTURES: bool = true;
override HAS_EMISSION_MAPS: bool = true;
override HAS_ROUGHNESS_MAPS: bool = true;
override HAS_NORMAL_MAPS: bool = true;
override HAS_DEEP_MAPS: bool = true;  // textures of 16 bits a channel
override HAS_COATS: bool = true;  // materials that are not purely Lambert

@group(1) @binding(0) var<storage, read> materials: array<Material>;
@group(1) @binding(1) var atlas_srgb: texture_2d_array<f32>;
@group(1) @binding(2) var atlas_linear: texture_2d_array<f32>;

// Returns the texels (x, y) and (x + 1, y + 1), wrapped into 0 .. size - 1 on each axis by its mode.
fn wrap(corner: vec2i, size: vec2i, mode: vec2u) -> vec4i {
    let mirrors = mode == vec2u(WRAP_MIRROR);
    // Divide as floats: CPU drivers divide integers much more slowly. All values are exact, below 2^24; the quotient's
    // rounding may put the remainder off by one period.
    let period = select(size, 2 * size, mirrors);
    let quotient = floor(vec2f(corner) / vec2f(period));
    var first = vec2i(vec2f(corner) - quotient * vec2f(period));
    first = select(first, first + period, first < vec2i(0));
    first = select(first, first - period, first >= period);
    var second = select(first + 1, vec2i(0), first + 1 >= period);
    // The second half of a mirrored period runs backwards; other modes have no second half.
    first = select(first, period - 1 - first, first >= size);
    second = select(second, period - 1 - second, second >= size);
    let clamps = mode == vec2u(WRAP_CLAMP);
    let low = clamp(corner, vec2i(0), size - 1);
    let high = clamp(corner + 1, vec2i(0), size - 1);
    return vec4i(select(first, low, clamps), select(second, high, clamps));
}

// Returns a texel; `low`: rows from the high to the low bytes of 16-bit channels, or 0.
fn load_texel(srgb: bool, x: i32, y: i32, layer: i32, low: i32) -> vec4f {
    if (srgb) {
        return textureLoad(atlas_srgb, vec2i(x, y), layer, 0);
    }
    let texel = textureLoad(atlas_linear, vec2i(x, y), layer, 0);
    if (HAS_DEEP_MAPS && low > 0) {
        // (256 high + low) / 65535, of bytes that are read as fractions of 255.
        return (texel * 256.0 + textureLoad(atlas_linear, vec2i(x, y + low), layer, 0)) / 257.0;
    }
    return texel;
}

// Returns the texture's value in a slot, bilinear or nearest, without mip levels: it aliases in the distance and is
// unbiased under jitter.
fn sample_texture(material: u32, slot: u32, uv0: vec2f, uv1: vec2f) -> vec4f {
    let t = materials[material].textures[slot];
    let uv_raw = vec3f(select(uv0, uv1, (t.flags & TEXCOORD_1) != 0u), 1.0);
    let uv = vec2f(dot(t.transform_u, uv_raw), dot(t.transform_v, uv_raw));
    let size = vec2i(t.size);
    // Coordinates beyond 2^24 texels have no fraction; keep the integers in range.
    let nearest = (t.flags & NEAREST) != 0u;
    let texel = clamp(uv * vec2f(size), vec2f(-1.6e7), vec2f(1.6e7)) - select(vec2f(0.5), vec2f(0.0), nearest);
    let base = floor(texel);
    let fraction = select(texel - base, vec2f(0.0), nearest);
    let mode = vec2u(t.flags >> WRAP_U_SHIFT, t.flags >> WRAP_V_SHIFT) & vec2u(3u);
    let place = vec4i(vec2i(t.corner), vec2i(t.corner)) + wrap(vec2i(base), size, mode);
    let layer = i32(t.layer);
    let srgb = slot <= EMISSION_SLOT;
    let low = select(0, size.y, (t.flags & SIXTEEN_BITS) != 0u);
    let top = mix(
        load_texel(srgb, place.x, place.y, layer, low), load_texel(srgb, place.z, place.y, layer, low), fraction.x);
    let bottom = mix(
        load_texel(srgb, place.x, place.w, layer, low), load_texel(srgb, place.z, place.w, layer, low), fraction.x);
    return mix(top, bottom, fraction.y);
}

fn has_texture(material: u32, slot: u32) -> bool {
    return (materials[material].textures[slot].flags & PRESENT) != 0u;
}

// Returns the density of light samples at a point of a textured emitter, in proportion to its light, 1/m2.
fn textured_pdf(material: u32, emission: vec3f) -> f32 {
    let whole = luminance(materials[material].emission);
    return materials[material].emitter_pdf * (luminance(emission) / max(whole, SMALLEST_NORMAL));
}
