// The uniforms shared by all passes of a frame: camera and scene (group 0).

struct View {
    position: vec3f,   // camera, metres, relative to the scene's origin
    orthographic: u32, // 1: parallel rays
    right: vec3f,      // from the picture's centre to its right edge, at unit distance (metres if orthographic)
    jitter: u32,       // 1: rays go through a random point of their pixel, 0: through its centre
    up: vec3f,         // from the picture's centre to its top edge, as `right`
    background: f32,   // factor on the environment where the camera sees it: 1, or 0 for a transparent background
    forward: vec3f,    // unit
    footprint: f32,    // pixels, side of the square that textures are averaged over; 0: points
    size: vec2u,       // pixels of this picture, which may be a window of a larger one
    offset: vec2f,     // point of each pixel that unjittered rays go through, pixels from its top left corner
    clip_from_world: mat4x4f,  // reversed depth: near / view depth, or 1 .. 0 to the far end if orthographic
    anisotropy: f32,   // most samples of a texture along the longer axis of a footprint
    whole: vec2u,      // pixels of the whole picture, to which `right`, `up` and `clip_from_world` belong
    corner: vec2u,     // the window's first pixel in the whole picture
}

struct SceneInfo {
    frame_low: vec3f,         // corner of the grid of the world's node boxes, metres
    root: u32,                // child reference of the whole scene
    frame_scale: vec3f,       // grid steps per metre
    light_count: u32,
    environment_color: vec3f, // constant radiance, or factor of the picture
    environment_pdf: f32,     // chance that a light sample picks the environment
    environment_rotation: f32,// in turns about +Y
    hittable_light: u32,      // 1: a ray can hit an emitter or environment
    light_unit: f32,          // a power of two near the brightest light: squares of light in this unit stay in range
    centre: vec3f,            // of a sphere around the scene, metres
    radius: f32,
    seed: u32,                // of choices at see-through surfaces that have no seed of their own
}

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<uniform> scene: SceneInfo;

struct Ray {
    origin: vec3f,
    direction: vec3f,  // need not be of unit length
}

// Returns a pixel of this picture as one of the whole picture: what random numbers and patterns depend on.
fn whole_pixel(pixel: vec2u) -> vec2u {
    return pixel + view.corner;
}

// Returns the ray through the point of a pixel of this picture that rasterisation samples.
fn pixel_ray(pixel: vec2u) -> Ray {
    return camera_ray(vec2f(whole_pixel(pixel)) + view.offset);
}

// Returns the ray through a point of the whole picture, in pixels from its top left corner.
fn camera_ray(pixel: vec2f) -> Ray {
    return ray_of(view, pixel);
}

// Returns the ray through a point of the whole picture of a view.
fn ray_of(v: View, pixel: vec2f) -> Ray {
    let ndc = pixel / vec2f(v.whole) * vec2f(2.0, -2.0) + vec2f(-1.0, 1.0);
    let offset = ndc.x * v.right + ndc.y * v.up;
    let parallel = v.orthographic != 0u;
    return Ray(
        v.position + select(vec3f(0.0), offset, parallel),
        select(normalize(v.forward + offset), v.forward, parallel));
}
