// A pixel of a level: the surface that it stands for, in 16 bytes.
#import "scene/info.wgsl"
#import "common/math.wgsl"

struct Surfel {
    position: vec3f,  // metres from the camera, along the axes of the world
    normal: vec3f,    // unit, shading, towards the viewer
    area: f32,        // of all surfaces that the pixel shows, m2
}

// Returns the area of a pixel of the whole picture on a plane that faces the camera, m2.
fn facing_area(position: vec3f) -> f32 {
    let depth = dot(position, view.forward);
    let per_depth = 4.0 * length(view.right) * length(view.up) / f32(view.size.x * view.size.y);
    return per_depth * select(depth * depth, 1.0, view.orthographic != 0u);
}

// Normals take 12 bits for each octahedral coordinate, 0 and 1 exactly. Areas are off by 3 % at most, which only moves
// the bound of near light.
fn pack_surfel(s: Surfel) -> vec4u {
    let normal = vec2u(round(octahedral_encode(s.normal) * 2047.0) + 2048.0);
    let area = u32(clamp(10.0 * log2(s.area / max(facing_area(s.position), 1e-37)), 0.0, 254.0) + 0.5);
    return vec4u(bitcast<vec3u>(s.position), normal.x | (normal.y << 12u) | ((area + 1u) << 24u));
}

fn is_empty(texel: vec4u) -> bool {
    return texel.w == 0u;
}

fn surfel_position(texel: vec4u) -> vec3f {
    return bitcast<vec3f>(texel.xyz);
}

fn surfel_normal(texel: vec4u) -> vec3f {
    return octahedral_decode((vec2f(vec2u(texel.w, texel.w >> 12u) & vec2u(4095u)) - 2048.0) * (1.0 / 2047.0));
}

fn surfel_area(texel: vec4u) -> f32 {
    return facing_area(surfel_position(texel)) * exp2(0.1 * f32((texel.w >> 24u) - 1u));
}
