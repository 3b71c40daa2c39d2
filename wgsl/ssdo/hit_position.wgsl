// The position and the weight of the surface that a direction hits, from the depth buffer of its source.
//
// Depth buffers are reversed: 0 where there is no surface. A plane's depth is linear over the picture.
#import "ssdo/search_radius.wgsl"
#import "ssdo/hit_code.wgsl"

@group(0) @binding(4) var<uniform> view_0: View;  // the main camera
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

// Returns the world position of a pixel of a view at a depth.
fn unproject(v: View, pixel: vec2u, depth: f32) -> vec3f {
    let ndc = (vec2f(pixel) + v.offset) / vec2f(v.size) * vec2f(2.0, -2.0) + vec2f(-1.0, 1.0);
    let aside = ndc.x * v.right + ndc.y * v.up;
    let parallel = v.orthographic != 0u;
    let origin = v.position + select(vec3f(0.0), aside, parallel);
    let direction = v.forward + select(aside, vec3f(0.0), parallel);
    // z and w of clip space are linear along the ray: find where their ratio is the depth.
    let m = v.clip_from_world;
    let start = (m * vec4f(origin, 1.0)).zw;
    let change = (m * vec4f(direction, 0.0)).zw;
    return origin + direction * ((depth * start.y - start.x) / (change.x - depth * change.y));
}

fn hit_position(hit: u32) -> vec3f {
    let pixel = hit_pixel(hit);
    let source = hit_source(hit);
    if (CAMERAS > 0u && source == 4u) {
        return unproject(view_1, pixel, textureLoad(depth_4, pixel, 0));
    }
    if (CAMERAS > 1u && source == 5u) {
        return unproject(view_2, pixel, textureLoad(depth_5, pixel, 0));
    }
    if (CAMERAS > 2u && source == 6u) {
        return unproject(view_3, pixel, textureLoad(depth_6, pixel, 0));
    }
    if (CAMERAS > 3u && source == 7u) {
        return unproject(view_4, pixel, textureLoad(depth_7, pixel, 0));
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
    return unproject(view_0, pixel, depth);
}

// Returns the weight of an occluder, 0 to 1: it fades towards the picture's border and towards r_max.
fn hit_weight(hit: u32, to_hit: vec3f, radius: f32) -> f32 {
    let inside = border_fade(vec2f(hit_pixel(hit)) + 0.5, vec2f(view_0.size));
    return inside * distance_fade(radius, length(to_hit));
}
