// Records of the lights that deferred techniques loop over (`upload/direct_lights.py`), and of their shadow views
// (`techniques/deferred/shadow_views.py`).
#import "common/math.wgsl"

const DIRECT_POINT: u32 = 0u;
const DIRECT_SPOT: u32 = 1u;
const DIRECT_SUN: u32 = 2u;
const DIRECT_AREA: u32 = 3u;   // a sample of an emitter: a small disc

struct DirectLight {
    position: vec3f,      // point, spot, area: metres relative to the scene's origin
    kind: u32,
    direction: vec3f,     // unit; spot, sun: of travel; area: normal of the side that shines
    inverse_range: f32,   // 1/m; 0: no range
    color: vec3f,         // point, spot: intensity W/sr; sun: irradiance W/m2; area: radiance W/(m2 sr)
    area: f32,            // area: part of the emitter that the sample represents, m2
    cone_scale: f32,      // spot: fall-off, as `common/spot.wgsl` takes it
    cone_offset: f32,
    first_view: u32,      // its first ShadowView
    view_count: u32,      // sun: cascades, the finest first; point: 6 faces; area: 5 or 6 faces; spot: 1, wide 5 or 6
    both_sides: u32,      // area: 1 shines from both sides of its disc
}

// Faces of a point light: +X -X +Y -Y +Z -Z of the world. Faces of an area light, and of a spot wider than 60 degrees
// off its axis: +Z, +X, -X, +Y, -Y (and -Z if both sides shine, or beyond 90 degrees) of
// `frame_from_normal(direction)`. Of five faces the last four are halves, those above the light's plane. Every view is
// two texels wider than its face.
struct ShadowView {
    clip_from_world: mat4x4f,  // reversed depth: 1 nearest to the light; perspective: infinite, sun: 0 at the far end
    right: vec3f,              // its axes in the world
    texel: f32,                // perspective: width of a texel at 1 m along the view's axis; sun: its width, metres
    up: vec3f,
    depth_scale: f32,          // perspective: depth = scale / distance along the axis; sun: offset + scale * distance
    forward: vec3f,
    depth_offset: f32,
    centre: vec2f,             // the axis' position in the atlas, texels
    corner: vec2f,             // of its rectangle in the atlas, texels; clip space covers the whole rectangle
    size: vec2f,               // texels
}

// The fields of ShadowView that a lookup needs: all from `right` on.
struct ShadowLookup {
    right: vec3f,
    texel: f32,
    up: vec3f,
    depth_scale: f32,
    forward: vec3f,
    depth_offset: f32,
    centre: vec2f,
    corner: vec2f,
    size: vec2f,
}
