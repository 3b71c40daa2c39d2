// Materials and their textures, as `upload/materials.py` packs them.
#import "common/brdf.wgsl"
#import "scene/textures.wgsl"

// material flags
const DOUBLE_SIDED: u32 = 1u;
const UNLIT: u32 = 2u;
const TEXTURED: u32 = 4u; // some texture is bound, so texture coordinates are needed
const COATED: u32 = 8u;   // Lambert under a GGX coat; without it, pure Lambert
const BLENDED: u32 = 16u; // light passes by 1 - alpha
const LAYERED: u32 = 32u; // it has layers (`common/layers.wgsl`)
const GLASS: u32 = 64u;   // parts may be thin, smooth glass, which passes light straight on by its colour
const SEE_THROUGH: u32 = BLENDED | GLASS;
const TRANSMITTING: u32 = 128u;  // any glass

struct Material {
    base_color: vec4f,
    emission: vec3f,       // W/(m2 sr)
    flags: u32,
    metallic: f32,
    roughness: f32,
    normal_scale: f32,
    alpha_cutoff: f32,     // 0: opaque
    emitter_pdf: f32,      // density of light samples where it emits all of `emission`, 1/m2; 0: no emitter
    // Layers; those that `common/layers.wgsl` explains have its units.
    dielectric_f0: f32,    // ((ior - 1) / (ior + 1))^2
    specular: f32,
    ior: f32,
    specular_color: vec3f,
    clearcoat: f32,
    sheen: vec3f,
    clearcoat_roughness: f32,
    attenuation: vec3f,
    clearcoat_normal_scale: f32,
    sheen_roughness: f32,
    transmission: f32,
    thickness: f32,        // metres in the mesh's space
    anisotropy: f32,
    anisotropy_direction: vec2f,  // cosine and sine of its rotation
    textures: array<TextureSlot, 13>,
}

// Slots of a material's textures. Those up to SHEEN_ROUGHNESS_SLOT lie in the sRGB-coded atlas, whose alpha is linear.
const BASE_COLOR_SLOT: u32 = 0u;
const EMISSION_SLOT: u32 = 1u;
const SPECULAR_SLOT: u32 = 2u;             // A
const SPECULAR_COLOR_SLOT: u32 = 3u;
const SHEEN_COLOR_SLOT: u32 = 4u;
const SHEEN_ROUGHNESS_SLOT: u32 = 5u;      // A
const METALLIC_ROUGHNESS_SLOT: u32 = 6u;   // B metallic, G roughness
const NORMAL_SLOT: u32 = 7u;
const CLEARCOAT_SLOT: u32 = 8u;            // R
const CLEARCOAT_ROUGHNESS_SLOT: u32 = 9u;  // G
const CLEARCOAT_NORMAL_SLOT: u32 = 10u;
const TRANSMISSION_SLOT: u32 = 11u;        // R
// RG direction, B amount. Without a texture, its transform and set of coordinates are those of the normal map: they give
// the tangent.
const ANISOTROPY_SLOT: u32 = 12u;

// Each is compiled out if the scene has none.
override HAS_TEXTURES: bool = true;
override HAS_EMISSION_MAPS: bool = true;
override HAS_ROUGHNESS_MAPS: bool = true;
override HAS_NORMAL_MAPS: bool = true;
override HAS_LAYER_MAPS: bool = true;  // textures of layers
override HAS_COATS: bool = true;       // materials that are not purely Lambert

@group(1) @binding(0) var<storage, read> materials: array<Material>;

// What a pixel or a ray covers: the sides of a parallelogram in both sets of texture coordinates, set 0 in xy and set 1
// in zw.
struct UvFootprint {
    x: vec4f,
    y: vec4f,
    anisotropy: f32,  // most samples along the longer side
}

fn image_of(material: u32, slot: u32) -> Image {
    return Image(
        materials[material].textures[slot].place, materials[material].textures[slot].flags, slot <= SHEEN_ROUGHNESS_SLOT);
}

// Returns coordinates in the image; `offset`: 1 for points, 0 for differences of points.
fn image_uv(material: u32, slot: u32, flags: u32, uv0: vec2f, uv1: vec2f, offset: f32) -> vec2f {
    let uv = select(uv0, uv1, (flags & TEXCOORD_1) != 0u);
    if ((flags & TRANSFORMED) == 0u) {
        return uv;
    }
    let of_point = vec3f(uv, offset);
    return vec2f(
        dot(materials[material].textures[slot].transform_u, of_point),
        dot(materials[material].textures[slot].transform_v, of_point));
}

// Returns the texture's value in a slot at a point, without mip levels: unbiased where points are random.
fn sample_texture(material: u32, slot: u32, uv0: vec2f, uv1: vec2f) -> vec4f {
    let image = image_of(material, slot);
    return read_point(image, image_uv(material, slot, image.flags, uv0, uv1, 1.0));
}

// Returns the texture's mean in a slot over a footprint, or its value at a point.
fn read_texture(material: u32, slot: u32, uv0: vec2f, uv1: vec2f, f: UvFootprint, is_point: bool) -> vec4f {
    if (is_point) {
        return sample_texture(material, slot, uv0, uv1);
    }
    let image = image_of(material, slot);
    return read_over(
        image, image_uv(material, slot, image.flags, uv0, uv1, 1.0),
        image_uv(material, slot, image.flags, f.x.xy, f.x.zw, 0.0),
        image_uv(material, slot, image.flags, f.y.xy, f.y.zw, 0.0), f.anisotropy);
}

fn has_texture(material: u32, slot: u32) -> bool {
    return (materials[material].textures[slot].flags & PRESENT) != 0u;
}

// Returns whether rays may pass a point of thin glass straight on. Its roughness is read at the point and without what
// normal maps add to it, so that rays, pixels and surfaces agree.
fn is_smooth_at(material: u32, uv0: vec2f, uv1: vec2f) -> bool {
    var roughness = materials[material].roughness;
    if (HAS_TEXTURES && has_texture(material, METALLIC_ROUGHNESS_SLOT)) {
        roughness *= sample_texture(material, METALLIC_ROUGHNESS_SLOT, uv0, uv1).g;
    }
    return roughness <= CLEAR_ROUGHNESS;
}

// Returns the density of light samples at a point of a textured emitter, in proportion to its light, 1/m2.
fn textured_pdf(material: u32, emission: vec3f) -> f32 {
    let whole = luminance(materials[material].emission);
    return materials[material].emitter_pdf * (luminance(emission) / max(whole, SMALLEST_NORMAL));
}
