// The visibility of a VPL from a receiver by its imperfect shadow map.
//
// V = [t >= t_map]: compares the receiver's distance from the VPL with that of the texel's plane in the same direction.
// Bias moves the receiver by shares of the texel's footprint: along its normal, times the sine of the angle between
// normal and VPL, and towards the VPL. The bias is small, because the texel's plane has the receiver's slope. Errs
// bright where an occluder is closer to the receiver than the bias, dark on surfaces that are curved within a texel or
// a cell, and either way at silhouettes.
#import "many_light/ism/map.wgsl"

@group(1) @binding(41) var ism_atlas: texture_storage_2d<r32uint, read>;

// Bias in footprints of a texel, metres. tools/README.md, "Constants".
const BIAS_NORMAL: f32 = 0.25;
const BIAS_DISTANCE: f32 = 0.1;

// A VPL and its map, shared by all receivers.
struct VplMap {
    position: vec3f,
    frame: mat3x3f,   // local to world; its third column is the normal
    corner: vec2u,
}

fn vpl_map(slot: u32, vpl: Vpl) -> VplMap {
    return VplMap(vpl.position, frame_from_normal(vpl.normal), map_corner(slot, textureDimensions(ism_atlas).x));
}

// Returns 1 where the receiver sees the VPL, else 0. `normal` is unit, on the lit side; the receiver lies above the
// VPL's plane.
fn map_visibility(map: VplMap, position: vec3f, normal: vec3f) -> f32 {
    let between = position - map.position;
    let squared = max(dot(between, between), 1e-30);
    let along = dot(between, normal);
    // A texel's side in the square from -1 to 1, which replaces its angle.
    let footprint = 2.0 / f32(ISM_RESOLUTION);
    // Move the receiver along its normal: distance * sine = sqrt(distance^2 - (distance * cosine)^2).
    let moved = between + normal * (BIAS_NORMAL * footprint * sqrt(max(squared - along * along, 0.0)));
    let distance = max(length(moved), 1e-30);
    // Find the receiver's texel.
    let local = (moved / distance) * map.frame;
    let place = hemisphere_encode(vec3f(local.xy, max(local.z, 0.0)));
    let point = clamp((place * 0.5 + 0.5) * f32(ISM_RESOLUTION), vec2f(0.0), vec2f(f32(ISM_RESOLUTION) - 0.001));
    let stored = textureLoad(ism_atlas, map.corner + vec2u(point)).r;
    // Compare the receiver, moved towards the VPL, with the texel's plane.
    let nearer = max(distance - BIAS_DISTANCE * footprint * sqrt(squared), 0.0);
    let code = distance_code(max(nearer * nearer, 1e-30));
    return select(0.0, 1.0, stored == 0u || code >= texel_code(stored, fract(point) - 0.5));
}

fn vpl_visibility(slot: u32, vpl: Vpl, position: vec3f, normal: vec3f) -> f32 {
    return map_visibility(vpl_map(slot, vpl), position, normal);
}
