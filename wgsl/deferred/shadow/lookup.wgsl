// Shadow map lookups: percentage-closer filtering (Reeves et al. 1987), or a verdict of lit, shadowed or undecided.
//
// Both biases scale with texels, not metres. The filter offsets the point along the normal by as much as its texels may
// lie below the surface. It errs bright up to about three texels inside a shadow, and soft at the edge. The verdict
// compares each texel with the receiver's plane (receiver plane depth bias). It is exact where it decides, but misses
// blockers thinner than a texel (errs bright).
#import "deferred/shadow/table.wgsl"
#import "common/layers.wgsl"

@group(1) @binding(27) var shadow_atlas: texture_depth_2d;
@group(1) @binding(46) var see_through_atlas: texture_depth_2d;  // as the atlas, of see-through surfaces alone
@group(1) @binding(28) var shadow_sampler: sampler_comparison;
@group(1) @binding(29) var gather_sampler: sampler;

// Texels to each side of a point that the filter reads: bilinear taps 0.5 off reach texel centres 1.5 away; 0.1 more
// covers the rounding of coordinates (2^-24 of 8192 texels is 0.0005) and of the 1/256 steps of hardware filters.
const FILTER_REACH: f32 = 1.6;
// Relative error of depths: 67 roundings of 2^-24, for projection and interpolation by rasterisation. tools/README.md,
// "Constants".
const DEPTH_ROUNDING: f32 = 4e-6;
// Depth differences in units of a texel's width plus the plane's change of depth across it: below OWN_PLANE a texel
// shows the receiver's plane, above CLEAR_OF_PLANE a blocker. tools/README.md, "Constants".
const OWN_PLANE: f32 = 0.1;
const CLEAR_OF_PLANE: f32 = 1.0;
// Cosine to the light below which a surface is undecided: across a texel its depth changes by 100 times the width.
const GRAZING: f32 = 0.01;

// Returns the face of a cube that a vector points through: +X -X +Y -Y +Z -Z.
fn cube_face(v: vec3f) -> u32 {
    let a = abs(v);
    if (a.x >= a.y && a.x >= a.z) {
        return select(1u, 0u, v.x >= 0.0);
    }
    if (a.y >= a.z) {
        return select(3u, 2u, v.y >= 0.0);
    }
    return select(5u, 4u, v.z >= 0.0);
}

// Each is compiled out if the scene has none.
override HAS_LAMPS: bool = true;   // points, spots, samples of emitters
override HAS_SUNS: bool = true;
override HAS_CUT_OUTS: bool = true;  // alpha-masked surfaces

// Returns the view of a lamp that holds a point, `offset` from it.
fn lamp_view_at(light: DirectLight, offset: vec3f) -> u32 {
    if (light.kind == DIRECT_SPOT && light.view_count == 1u) {
        return light.first_view;
    }
    if (light.kind == DIRECT_POINT) {
        return light.first_view + cube_face(offset);
    }
    // Faces of a frame along its normal: +Z +X -X +Y -Y -Z.
    let face = cube_face(offset * frame_from_normal(light.direction));
    return light.first_view + select(select(face + 1u, 0u, face == 4u), 5u, face == 5u);
}

// Returns the view that holds a point, `offset` from its light; `count`: number of lights.
fn shadow_view_at(light: DirectLight, count: u32, position: vec3f, offset: vec3f) -> ShadowLookup {
    if (HAS_SUNS && (!HAS_LAMPS || light.kind == DIRECT_SUN)) {
        var view = load_view(light.first_view, count);
        for (var k = 1u; k < light.view_count; k += 1u) {
            let place = view.centre + vec2f(dot(view.right, position), -dot(view.up, position)) / view.texel;
            // The normal offset moves a point sideways by up to 1.42 times the filter's reach.
            let from_middle = place - view.corner - 0.5 * view.size;
            if (all(abs(from_middle) <= 0.5 * view.size - 2.5 * FILTER_REACH)) {
                break;
            }
            view = load_view(light.first_view + k, count);
        }
        return view;
    }
    if (!HAS_LAMPS) {
        return load_view(light.first_view, count);
    }
    return load_view(lamp_view_at(light, offset), count);
}

// A point projected into a view.
struct Projected {
    texel: vec2f,      // place in the atlas
    depth: f32,        // reversed
    along: f32,        // distance from the light along the axis, metres; sun: 1
    unit: f32,         // a texel's width at the point, as a difference of depth
}

fn project(view: ShadowLookup, is_sun: bool, position: vec3f, offset: vec3f) -> Projected {
    let q = select(offset, position, is_sun);
    let distance = dot(view.forward, q);
    // Points behind a lamp's view get no light from it.
    let along = select(max(distance, 1e-30), 1.0, is_sun);
    let place = vec2f(dot(view.right, q), -dot(view.up, q)) / (along * view.texel);
    let depth = select(view.depth_scale / along, view.depth_offset + view.depth_scale * distance, is_sun);
    let unit = view.texel * select(depth, -view.depth_scale, is_sun);
    let texel = clamp(view.centre + place, view.corner + 1.0, view.corner + view.size - 1.0);
    return Projected(texel, depth, along, unit);
}

// Returns the filter's normal offset, metres: a plane rises towards the light within FILTER_REACH texels, in proportion
// to its normal's lean along their axes.
fn shadow_lift(view: ShadowLookup, is_sun: bool, offset: vec3f, normal: vec3f, to_light: vec3f) -> vec3f {
    let along = select(dot(view.forward, offset), 1.0, is_sun);
    let lean = abs(dot(normal, view.right)) + abs(dot(normal, view.up));
    return normal * (select(-FILTER_REACH, FILTER_REACH, dot(normal, to_light) >= 0.0) * view.texel * along * lean);
}

// Returns the distance along `to_light` up to which the filter's bias hides blockers, metres: there the shadow ray is
// as high above the surface as the offset.
fn shadow_bias(light: DirectLight, count: u32, position: vec3f, normal: vec3f, to_light: vec3f) -> f32 {
    let offset = position - light.position;
    let is_sun = HAS_SUNS && (!HAS_LAMPS || light.kind == DIRECT_SUN);
    let view = shadow_view_at(light, count, position, offset);
    let lift = shadow_lift(view, is_sun, offset, normal, to_light);
    let rounding = DEPTH_ROUNDING * select(length(offset), abs(1.0 / view.depth_scale), is_sun);
    return length(lift) / max(abs(dot(normal, to_light)), GRAZING) + rounding;
}

// Returns the lit share of the filter, 0 to 1. `normal` is geometric and `to_light` unit.
fn shadow_filter(light: DirectLight, count: u32, position: vec3f, normal: vec3f, to_light: vec3f) -> f32 {
    let offset = position - light.position;
    let is_sun = HAS_SUNS && (!HAS_LAMPS || light.kind == DIRECT_SUN);
    let view = shadow_view_at(light, count, position, offset);
    let lift = shadow_lift(view, is_sun, offset, normal, to_light);
    let p = project(view, is_sun, position + lift, offset + lift);
    let depth = p.depth + select(p.depth, 1.0, is_sun) * DEPTH_ROUNDING;
    let scale = 1.0 / vec2f(textureDimensions(shadow_atlas));
    var lit = 0.0;
    lit += textureSampleCompareLevel(shadow_atlas, shadow_sampler, (p.texel + vec2f(-0.5, -0.5)) * scale, depth);
    lit += textureSampleCompareLevel(shadow_atlas, shadow_sampler, (p.texel + vec2f(0.5, -0.5)) * scale, depth);
    lit += textureSampleCompareLevel(shadow_atlas, shadow_sampler, (p.texel + vec2f(-0.5, 0.5)) * scale, depth);
    lit += textureSampleCompareLevel(shadow_atlas, shadow_sampler, (p.texel + vec2f(0.5, 0.5)) * scale, depth);
    return lit * 0.25;
}

// Returns the depths of the texels (0, 1), (1, 1), (1, 0), (0, 0) from `corner` on, relative to the point's plane.
fn depths_above(p: Projected, slope: vec2f, corner: vec2f) -> vec4f {
    let scale = 1.0 / vec2f(textureDimensions(shadow_atlas));
    return above_plane(p, slope, corner, textureGather(shadow_atlas, gather_sampler, (corner + 1.0) * scale));
}

// Returns the depths of see-through surfaces, as `depths_above`.
fn see_through_above(p: Projected, slope: vec2f, corner: vec2f) -> vec4f {
    let scale = 1.0 / vec2f(textureDimensions(see_through_atlas));
    return above_plane(p, slope, corner, textureGather(see_through_atlas, gather_sampler, (corner + 1.0) * scale));
}

fn above_plane(p: Projected, slope: vec2f, corner: vec2f, depths: vec4f) -> vec4f {
    let from_point = corner + 0.5 - p.texel;
    return depths - p.depth - slope.x * (from_point.x + vec4f(0.0, 1.0, 1.0, 0.0))
        - slope.y * (from_point.y + vec4f(1.0, 1.0, 0.0, 0.0));
}

fn max4(v: vec4f) -> f32 {
    return max(max(v.x, v.y), max(v.z, v.w));
}

const UNDECIDED: f32 = -1.0;

struct Verdict {
    lit: f32,    // 1, 0 or UNDECIDED
    reach: f32,  // length of the shadow ray of an undecided point: metres to a sun, else a share of the way to the light
}

// Shadow rays end at this many times the height above the receiver's plane of the highest texel around the point, plus
// CLEAR_OF_PLANE. In three views of Sponza at 640x360, 2 and 4 err like rays to the sun, 1 gives 5 more wrong pixels,
// and 0.5 gives 1 to 4 %; all take the same time.
const REACH_OVER_TEXELS: f32 = 2.0;

// Returns a verdict of lit if no texel around the point shows anything above its plane and the 2x2 nearest show the
// plane itself, of shadowed if all show a blocker well above it. Undecided are a shadow's edge, a contact, geometry
// finer than the texels, depths too coarse for them, and what lies behind a see-through surface. The 2x2 texels around
// the point must agree; with cut-outs, such as leaves, which are often finer than texels, the 4x4 around it.
//
// Over a plane n . q = k, depth is linear in the texels: for a sun q . forward = (k - n_x q_x - n_y q_y) / n_z, for a
// lamp near / (q . forward) = near (n_x q_x / q_z + n_y q_y / q_z + n_z) / k.
fn shadow_verdict(light: DirectLight, count: u32, position: vec3f, normal: vec3f, to_light: vec3f) -> Verdict {
    let offset = position - light.position;
    let is_sun = HAS_SUNS && (!HAS_LAMPS || light.kind == DIRECT_SUN);
    let view = shadow_view_at(light, count, position, offset);
    let p = project(view, is_sun, position, offset);
    let n = vec2f(dot(normal, view.right), -dot(normal, view.up));
    let across = select(dot(normal, offset), -dot(normal, view.forward), is_sun);
    // The slope overflows only for a surface edge-on to the light, which is undecided.
    let slope = n * (view.texel * view.depth_scale / across);
    let steep = p.unit + abs(slope.x) + abs(slope.y);
    let rounding = select(p.depth, 1.0, is_sun) * DEPTH_ROUNDING;
    let own = OWN_PLANE * steep + rounding;
    let clear = CLEAR_OF_PLANE * steep + rounding;

    let corner = floor(p.texel - 0.5);
    var near: vec4f;  // depths of the 2x2 texels around the point, relative to its plane
    var lowest: f32;  // and of all texels that must agree
    var highest: f32;
    if (HAS_CUT_OUTS) {
        let a = depths_above(p, slope, corner + vec2f(-1.0, -1.0));
        let b = depths_above(p, slope, corner + vec2f(1.0, -1.0));
        let c = depths_above(p, slope, corner + vec2f(-1.0, 1.0));
        let d = depths_above(p, slope, corner + vec2f(1.0, 1.0));
        near = vec4f(a.y, b.x, c.z, d.w);
        lowest = -max4(max(max(-a, -b), max(-c, -d)));
        highest = max4(max(max(a, b), max(c, d)));
    } else {
        near = depths_above(p, slope, corner);
        lowest = -max4(-near);
        highest = max4(near);
    }
    let is_own = highest <= own && max4(-near) <= own;
    let is_clear = lowest > clear;
    // Where rounding exceeds OWN_PLANE, as in a fine cascade of a scene of kilometres, it may hide a blocker or seem one.
    let is_coarse = rounding > OWN_PLANE * steep || abs(dot(normal, to_light)) < GRAZING;
    var lit = select(select(select(UNDECIDED, 0.0, is_clear), 1.0, is_own), UNDECIDED, is_coarse);
    var needs_whole_ray = is_coarse;
    if (HAS_SEE_THROUGH || PASSES_GLASS) {
        let a = see_through_above(p, slope, corner + vec2f(-1.0, -1.0));
        let b = see_through_above(p, slope, corner + vec2f(1.0, -1.0));
        let c = see_through_above(p, slope, corner + vec2f(-1.0, 1.0));
        let d = see_through_above(p, slope, corner + vec2f(1.0, 1.0));
        let is_behind = max4(max(max(a, b), max(c, d))) > own;
        lit = select(lit, UNDECIDED, is_behind && lit != 0.0);
        needs_whole_ray = needs_whole_ray || is_behind;
    }
    // Blockers may rise between the texels' centres.
    let above = REACH_OVER_TEXELS * (max(highest, 0.0) + clear);
    let reach = above / select(p.depth + above, -view.depth_scale, is_sun);
    return Verdict(lit, select(reach, select(1.0, FLOAT_MAX, is_sun), needs_whole_ray));
}
