// What a material has beyond base colour, metallic and roughness: Khronos' extensions of glTF's metallic-roughness model.

// Each is compiled out if the scene has none.
override HAS_SPECULAR: bool = true;      // another f0 or f90 than 0.04 and 1 (KHR_materials_ior, specular)
override HAS_CLEARCOAT: bool = true;     // KHR_materials_clearcoat
override HAS_SHEEN: bool = true;         // KHR_materials_sheen
override HAS_ANISOTROPY: bool = true;    // KHR_materials_anisotropy
override HAS_TRANSMISSION: bool = true;  // KHR_materials_transmission
override HAS_VOLUMES: bool = true;       // KHR_materials_volume: transmission through solids
override HAS_LAYERS: bool = true;        // any of these
override HAS_BLENDS: bool = true;        // alpha blending
override HAS_SEE_THROUGH: bool = true;   // alpha blending or thin, smooth transmission: rays pass straight on
override HAS_TINTS: bool = true;         // thin, smooth transmission: rays that pass or hit it carry weights
override PASSES_GLASS: bool = true;      // shadow rays pass rough and solid transmission, too, straight on

const CLEAR_ROUGHNESS: f32 = 0.05;  // thin glass that is at most so rough passes rays straight on

struct Layers {
    f0: vec3f,                // of the dielectric, at normal incidence
    f90: f32,                 // of the dielectric, at grazing incidence
    ior: f32,                 // at least 1
    clearcoat: f32,           // share of the surface under a clear coat
    clearcoat_roughness: f32,
    clearcoat_normal: vec3f,  // unit, world space, facing the viewer
    sheen: vec3f,
    sheen_roughness: f32,
    anisotropy: f32,          // 0 .. 1
    tangent: vec3f,           // unit, world space: the direction in which the specular lobe is stretched
    transmission: f32,        // share of the light past the specular reflection that passes instead of being scattered
    thickness: f32,           // metres; 0: a thin wall
    attenuation: vec3f,       // absorption coefficient of the volume, 1/m
}

// Returns the layers of a plain glTF material: a dielectric of index of refraction 1.5.
fn no_layers() -> Layers {
    return Layers(
        vec3f(0.04), 1.0, 1.5, 0.0, 0.0, vec3f(0.0, 0.0, 1.0), vec3f(0.0), 0.0, 0.0, vec3f(1.0, 0.0, 0.0), 0.0, 0.0,
        vec3f(0.0));
}
