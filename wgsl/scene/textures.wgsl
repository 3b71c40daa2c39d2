// Textures: their places in the atlases, as `upload/texture_atlas.py` packs them, and their filters.
//
// Level k has the size of the image divided by 2^k, rounded down. A footprint is filtered by `anisotropy` samples at
// most along its longer axis, each bilinear in two levels (McCormack et al. 1999, "Feline", with equal weights): the
// level whose texels have the area that each sample stands for. A footprint too long for its samples is blurred across
// and aliases along it; one smaller than a texel reads the finest level. Sponza, aisle, 640x360, relMSE of a frame of
// direct light against 256 jittered ones, at most 1, 2, 4 samples: 0.0111, 0.0067, 0.0064; with texels as long as the
// samples' distance 0.0159, 0.0075, 0.0068; points 0.0252.

// texture flags; above them the number of mip levels below the finest
const PRESENT: u32 = 1u;
const TEXCOORD_1: u32 = 2u;
const MAG_NEAREST: u32 = 4u;
const SIXTEEN_BITS: u32 = 8u;  // of each channel: the low bytes lie below the high ones
const WRAP_U_SHIFT: u32 = 4u;
const WRAP_V_SHIFT: u32 = 6u;
const WRAP_CLAMP: u32 = 1u;
const WRAP_MIRROR: u32 = 2u;
const MIN_NEAREST: u32 = 256u;
const MIP_NEAREST: u32 = 512u;
const TRANSFORMED: u32 = 1024u;  // the transform is not the identity
const LEVELS_SHIFT: u32 = 11u;

// An image's place in the atlas, its sampler, and the rows of uv' = M (u, v, 1).
struct TextureSlot {
    place: vec4u,  // two halves in each word: corner of the finest level, its size, corner of level 1, in texels; layer
                   // of the finest level, of all others
    flags: u32,
    transform_u: vec3f,
    transform_v: vec3f,
}

const BORDER: u32 = 1u;      // texels around each level: its neighbours by the wrap modes
const LONGEST: f32 = 64.0;   // length of a footprint over its width: edge-on surfaces would read the finest level
const LEVEL_ROWS: u32 = 3u;  // `upload/texture_atlas.py`, `level_corner`

override HAS_DEEP_MAPS: bool = true;  // textures of 16 bits a channel

@group(1) @binding(1) var atlas_srgb: texture_2d_array<f32>;
@group(1) @binding(2) var atlas_linear: texture_2d_array<f32>;
@group(1) @binding(6) var atlas_sampler: sampler;  // bilinear

// A texture as it is read: its slot's values, and the atlas.
struct Image {
    place: vec4u,
    flags: u32,
    srgb: bool,
}

// A mip level in the atlas.
struct Level {
    size: vec2f,    // texels
    corner: vec2f,
    layer: u32,
    low: u32,       // rows from the high to the low bytes of 16-bit channels; 0: they have 8 bits
    nearest: bool,
}

fn halves(pair: u32) -> vec2u {
    return vec2u(pair & 0xffffu, pair >> 16u);
}

fn level_of(image: Image, level: u32, nearest: bool) -> Level {
    // Level 1 is followed by a column of the coarser ones; `level_corner` in `upload/texture_atlas.py`.
    let size = halves(image.place.y);
    let layers = halves(image.place.w);
    let first = max(size >> vec2u(1u), vec2u(1u));
    let before = max(level, 2u) - 2u;
    let column = vec2u(first.x + 2u * BORDER, first.y - (first.y >> before) + LEVEL_ROWS * before);
    let chain = halves(image.place.z) + select(vec2u(0u), column, level > 1u);
    let chain_rows = first.y + LEVEL_ROWS * (image.flags >> LEVELS_SHIFT);
    let finest = level == 0u;
    let low = select(chain_rows, size.y + 2u * BORDER, finest);
    return Level(
        vec2f(max(size >> vec2u(level), vec2u(1u))), vec2f(select(chain, halves(image.place.x), finest)),
        select(layers.y, layers.x, finest), select(0u, low, (image.flags & SIXTEEN_BITS) != 0u), nearest);
}

// Returns texture coordinates wrapped into 0 .. 1 on each axis by the modes.
fn wrap(flags: u32, uv: vec2f) -> vec2f {
    let mode = vec2u(flags >> WRAP_U_SHIFT, flags >> WRAP_V_SHIFT) & vec2u(3u);
    let mirrored = 1.0 - abs(fract(uv * 0.5) * 2.0 - 1.0);
    let wrapped = select(fract(uv), mirrored, mode == vec2u(WRAP_MIRROR));
    // Rounding may reach 1; infinite coordinates become NaN.
    return clamp(select(wrapped, uv, mode == vec2u(WRAP_CLAMP)), vec2f(0.0), vec2f(1.0));
}

// Returns a texel of the linear atlas; `low`: rows from the high to the low bytes of 16-bit channels, or 0.
fn load_texel(x: i32, y: i32, layer: i32, low: i32) -> vec4f {
    let texel = textureLoad(atlas_linear, vec2i(x, y), layer, 0);
    if (HAS_DEEP_MAPS && low > 0) {
        // (256 high + low) / 65535, of bytes that are read as fractions of 255.
        return (texel * 256.0 + textureLoad(atlas_linear, vec2i(x, y + low), layer, 0)) / 257.0;
    }
    return texel;
}

// Returns the value of a level at wrapped coordinates, bilinear or nearest.
fn read_level(level: Level, srgb: bool, uv: vec2f) -> vec4f {
    var texel = uv * level.size;
    if (level.nearest) {
        texel = min(floor(texel), level.size - 1.0) + 0.5;
    }
    if (srgb) {
        let page = 1.0 / vec2f(textureDimensions(atlas_srgb));
        return textureSampleLevel(atlas_srgb, atlas_sampler, (level.corner + texel) * page, level.layer, 0.0);
    }
    // Data are interpolated here: llvmpipe's sampler rounds the result to 8 bits, which shows in shiny normal maps, and
    // loading a texel that is not sRGB-coded costs a fifth of its bilinear sample.
    let base = floor(texel - 0.5);
    let fraction = texel - 0.5 - base;
    let place = vec2i(level.corner + base);
    let layer = i32(level.layer);
    let low = i32(level.low);
    let top = mix(
        load_texel(place.x, place.y, layer, low), load_texel(place.x + 1, place.y, layer, low), fraction.x);
    let bottom = mix(
        load_texel(place.x, place.y + 1, layer, low), load_texel(place.x + 1, place.y + 1, layer, low), fraction.x);
    return mix(top, bottom, fraction.y);
}

// Returns the value of the finest level at a point.
fn read_point(image: Image, uv: vec2f) -> vec4f {
    let level = level_of(image, 0u, (image.flags & MAG_NEAREST) != 0u);
    return read_level(level, image.srgb, wrap(image.flags, uv));
}

// Returns the mean over a parallelogram of sides `x` and `y` about a point, by at most `most` samples along it.
fn read_over(image: Image, uv: vec2f, x: vec2f, y: vec2f, most: f32) -> vec4f {
    // Find the longer side, and the width across it, in texels.
    let size = vec2f(halves(image.place.y));
    let x_squared = dot(x * size, x * size);
    let y_squared = dot(y * size, y * size);
    let longer = select(y, x, x_squared > y_squared);
    let squared = max(x_squared, y_squared);
    let area = max(abs(x.x * y.y - x.y * y.x) * size.x * size.y, squared / LONGEST);
    // Divide it into samples that are as long as wide. Nearest filters take one.
    let is_nearest = (image.flags & MIN_NEAREST) != 0u;
    let limit = select(most, 1.0, is_nearest || squared <= 1.0);
    let samples = clamp(ceil(squared / max(area, 1e-20)), 1.0, max(limit, 1.0));
    let exact = 0.5 * log2(max(area / samples, 1e-20));
    let nearest = select(is_nearest, (image.flags & MAG_NEAREST) != 0u, exact <= 0.0);
    let rounded = select(exact, round(exact), (image.flags & MIP_NEAREST) != 0u);
    let level = clamp(rounded, 0.0, f32(image.flags >> LEVELS_SHIFT));
    let number = u32(level);
    let share = level - f32(number);
    // Take the samples one by one, in both levels where the level lies between two. One loop with one read takes all:
    // four reads in branches cost the G-buffer 12 to 29 % more time (Sponza, 1920x1080, llvmpipe 22.3).
    let step = longer / samples;
    let levels = select(1u, 2u, share > 0.0);
    var at = uv + 0.5 * (step - longer);
    var coarser = 0u;
    var taken = 0.0;
    var sum = vec4f(0.0);
    loop {
        let weight = select(1.0 - share, share, coarser > 0u);
        sum += weight * read_level(level_of(image, number + coarser, nearest), image.srgb, wrap(image.flags, at));
        coarser += 1u;
        if (coarser == levels) {
            coarser = 0u;
            taken += 1.0;
            at += step;
        }
        // Ends for NaN, too.
        if (!(taken < samples)) {
            break;
        }
    }
    return sum / samples;
}
