// Whether a VPL sees a surface, by its imperfect shadow map.
//
// The plane of the texel that the receiver falls on, against the receiver's distance. It is moved off its surface by a
// share of the texel's footprint, along its normal times the sine of the angle to the VPL, and towards the VPL: little,
// since a plane explains the slope. Errs bright where an occluder is nearer to the receiver than that, dark on surfaces
// that bulge within a texel or a cell, and at silhouettes either way, by what the map missed.
#import "many_light/ism/map.wgsl"

@group(1) @binding(41) var ism_atlas: texture_storage_2d<r32uint, read>;

// In footprints of a texel, chosen by the rates of false light and false shadow in Cornell and Sponza.
const BIAS_NORMAL: f32 = 0.25;
const BIAS_DISTANCE: f32 = 0.1;

// What is the same for all receivers of a VPL.
struct VplMap {
    position: vec3f,
    frame: mat3x3f,   // local to world; its third column is the normal
    corner: vec2u,
}

fn vpl_map(slot: u32, vpl: Vpl) -> VplMap {
    return VplMap(vpl.position, frame_from_normal(vpl.normal), map_corner(slot, textureDimensions(ism_atlas).x));
}

// Returns 1 where a surface sees the VPL and 0 where something stands between. `normal` is unit, of the side that is
// lit; the receiver lies above the VPL's plane.
fn map_visibility(map: VplMap, position: vec3f, normal: vec3f) -> f32 {
    const TEXEL: f32 = 2.0;
    let between = position - map.position;
    let squared = max(dot(between, between), 1e-30);
    let along = dot(between, normal);
    // distance * sine = sqrt(distance^2 - (distance * cosine)^2)
    let footprint = TEXEL / f32(ISM_RESOLUTION);
    let moved = between + normal * (BIAS_NORMAL * footprint * sqrt(max(squared - along * along, 0.0)));
    let distance = max(length(moved), 1e-30);
    let local = (moved / distance) * map.frame;
    let place = hemisphere_encode(vec3f(local.xy, max(local.z, 0.0)));
    let point = clamp((place * 0.5 + 0.5) * f32(ISM_RESOLUTION), vec2f(0.0), vec2f(f32(ISM_RESOLUTION) - 0.001));
    let stored = textureLoad(ism_atlas, map.corner + vec2u(point)).r;
    let nearer = max(distance - BIAS_DISTANCE * footprint * sqrt(squared), 0.0);
    let code = distance_code(max(nearer * nearer, 1e-30));
    return select(0.0, 1.0, stored == 0u || code >= texel_code(stored, fract(point) - 0.5));
}

fn vpl_visibility(slot: u32, vpl: Vpl, position: vec3f, normal: vec3f) -> f32 {
    return map_visibility(vpl_map(slot, vpl), position, normal);
}
