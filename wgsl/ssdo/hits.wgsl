// The surfaces that directions meet, as the pixel that shows them and the source that the pixel belongs to: the layers
// of the camera's depth peeling are sources 0 to 3, further cameras 4 to 7.
//
// Depths are those of depth buffers: reversed, 0 where there is nothing, and planes are linear over the picture.
#import "scene/info.wgsl"
#import "common/math.wgsl"

override LAYERS: u32 = 1u;   // of depth peeling, 1 to 4
override CAMERAS: u32 = 0u;  // further ones, 0 to 4

const NO_HIT: u32 = 0xffffffffu;
const FIRST_CAMERA: u32 = 4u;
// Share of the reach from which on occluders fade (section 7.2). Chosen.
const FADE_FROM: f32 = 0.75;

@group(0) @binding(4) var<uniform> view_0: View;  // the camera
@group(0) @binding(5) var<uniform> view_1: View;
@group(0) @binding(6) var<uniform> view_2: View;
@group(0) @binding(7) var<uniform> view_3: View;
@group(0) @binding(8) var<uniform> view_4: View;

@group(1) @binding(50) var depth_0: texture_depth_2d;
@group(1) @binding(51) var depth_1: texture_depth_2d;
@group(1) @binding(52) var depth_2: texture_depth_2d;
@group(1) @binding(53) var depth_3: texture_depth_2d;
@group(1) @binding(54) var depth_4: texture_depth_2d;
@group(1) @binding(55) var depth_5: texture_depth_2d;
@group(1) @binding(56) var depth_6: texture_depth_2d;
@group(1) @binding(57) var depth_7: texture_depth_2d;

// Sides of pictures are at most 2^13, so that a place has 26 bits.
fn pack_hit(pixel: vec2u, source: u32) -> u32 {
    return pixel.x | (pixel.y << 13u) | (source << 26u);
}

fn pixel_of_hit(hit: u32) -> vec2u {
    return vec2u(hit & 0x1fffu, (hit >> 13u) & 0x1fffu);
}

fn source_of_hit(hit: u32) -> u32 {
    return hit >> 26u;
}

// Returns the point that a pixel shows at a depth.
fn point_at(v: View, pixel: vec2u, depth: f32) -> vec3f {
    let ndc = (vec2f(pixel) + v.offset) / vec2f(v.size) * vec2f(2.0, -2.0) + vec2f(-1.0, 1.0);
    let aside = ndc.x * v.right + ndc.y * v.up;
    let parallel = v.orthographic != 0u;
    let origin = v.position + select(vec3f(0.0), aside, parallel);
    let direction = v.forward + select(aside, vec3f(0.0), parallel);
    // Along the ray, z and w of clip space are linear: find where their ratio is the depth.
    let m = v.clip_from_world;
    let start = (m * vec4f(origin, 1.0)).zw;
    let change = (m * vec4f(direction, 0.0)).zw;
    return origin + direction * ((depth * start.y - start.x) / (change.x - depth * change.y));
}

fn hit_position(hit: u32) -> vec3f {
    let pixel = pixel_of_hit(hit);
    let source = source_of_hit(hit);
    if (CAMERAS > 0u && source == 4u) {
        return point_at(view_1, pixel, textureLoad(depth_4, pixel, 0));
    }
    if (CAMERAS > 1u && source == 5u) {
        return point_at(view_2, pixel, textureLoad(depth_5, pixel, 0));
    }
    if (CAMERAS > 2u && source == 6u) {
        return point_at(view_3, pixel, textureLoad(depth_6, pixel, 0));
    }
    if (CAMERAS > 3u && source == 7u) {
        return point_at(view_4, pixel, textureLoad(depth_7, pixel, 0));
    }
    var depth = textureLoad(depth_0, pixel, 0);
    if (LAYERS > 1u) {
        depth = select(depth, textureLoad(depth_1, pixel, 0), source == 1u);
    }
    if (LAYERS > 2u) {
        depth = select(depth, textureLoad(depth_2, pixel, 0), source == 2u);
    }
    if (LAYERS > 3u) {
        depth = select(depth, textureLoad(depth_3, pixel, 0), source == 3u);
    }
    return point_at(view_0, pixel, depth);
}

// Returns how much an occluder counts: less towards the border of the hemisphere, and within EDGE_FADE of the border of
// a picture, so that it does not come and go at once.
fn hit_weight(hit: u32, to_hit: vec3f, reach: f32) -> f32 {
    let size = vec2f(view_0.size);
    let place = vec2f(pixel_of_hit(hit)) + 0.5;
    let from_edge = min(place, size - place) / (EDGE_FADE * size.y);
    let shown = clamp(min(from_edge.x, from_edge.y), 0.0, 1.0);
    return shown * (1.0 - smoothstep(FADE_FROM * reach, reach, length(to_hit)));
}

// Of the picture's height. Chosen.
const EDGE_FADE: f32 = 0.01;
