// How much of a light arrives at a point, by the shadow maps: percentage-closer filtering (Reeves et al. 1987).
//
// The point is moved off its surface by as much as the filter's texels may lie below it, so the bias is in texels and
// by slope, not in metres. Errs bright within about two texels of a contact, and soft by a texel at a shadow's edge.
#import "shadow/views.wgsl"

@group(1) @binding(25) var<storage, read> direct_lights: array<DirectLight>;
@group(1) @binding(26) var<storage, read> shadow_views: array<ShadowView>;
@group(1) @binding(27) var shadow_atlas: texture_depth_2d;
@group(1) @binding(28) var shadow_sampler: sampler_comparison;
@group(1) @binding(29) var gather_sampler: sampler;

// The filter reaches 1.5 texels to each side of the point, and the nearest texel centre half a texel more.
const FILTER_REACH: f32 = 2.0;
// Of the depth: rounding of float32 in the projection and of the interpolation by rasterisation. Chosen.
const DEPTH_ROUNDING: f32 = 4e-6;
// Within this share of a texel's width, and of the change of depth across it, a texel shows the point's own plane; from
// that many on, something else. Chosen.
const OWN_PLANE: f32 = 0.1;
const CLEAR_OF_PLANE: f32 = 2.0;
// Cosine below which a surface is too steep for its texels.
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

// Returns the view of a light that holds a point.
fn shadow_view_at(light: u32, position: vec3f) -> u32 {
    let first = direct_lights[light].first_view;
    let count = direct_lights[light].view_count;
    let kind = direct_lights[light].kind;
    if (kind == DIRECT_SUN) {
        var view = first;
        for (var k = 0u; k + 1u < count; k += 1u) {
            let clip = shadow_views[first + k].clip_from_world * vec4f(position, 1.0);
            let margin = 1.0 - 4.0 * FILTER_REACH / shadow_views[first + k].size.x;
            if (max(abs(clip.x), abs(clip.y)) <= margin) {
                break;
            }
            view += 1u;
        }
        return view;
    }
    let offset = position - direct_lights[light].position;
    if (kind == DIRECT_SPOT && count == 1u) {
        return first;
    }
    if (kind == DIRECT_POINT) {
        return first + cube_face(offset);
    }
    // Faces of a frame along its normal: +Z +X -X +Y -Y -Z.
    let face = cube_face(offset * frame_from_normal(direct_lights[light].direction));
    return first + select(select(face + 1u, 0u, face == 4u), 5u, face == 5u);
}

// A point in a shadow view: its place in the atlas in texels, and its depth.
struct Projected {
    texel: vec2f,
    depth: f32,
    is_behind: bool,
}

fn project(index: u32, position: vec3f) -> Projected {
    let size = shadow_views[index].size;
    let clip = shadow_views[index].clip_from_world * vec4f(position, 1.0);
    let ndc = clip.xyz / clip.w;
    let inside = clamp((ndc.xy * vec2f(0.5, -0.5) + 0.5) * size, vec2f(1.0), size - 1.0);
    return Projected(shadow_views[index].corner + inside, ndc.z, clip.w <= 0.0);
}

// Returns the share of the filter that sees the light, 0 to 1. `normal` is geometric and `to_light` unit.
fn shadow_filter(light: u32, position: vec3f, normal: vec3f, to_light: vec3f) -> f32 {
    if (direct_lights[light].view_count == 0u) {
        return 1.0;
    }
    let index = shadow_view_at(light, position);
    let is_sun = direct_lights[light].kind == DIRECT_SUN;
    let along = (shadow_views[index].clip_from_world * vec4f(position, 1.0)).w;
    let footprint = shadow_views[index].texel * select(along, 1.0, is_sun);
    let cosine = dot(normal, to_light);
    let sine = sqrt(max(1.0 - cosine * cosine, 0.0));
    let side = select(-1.0, 1.0, cosine >= 0.0);
    let p = project(index, position + normal * (side * FILTER_REACH * footprint * sine));
    if (p.is_behind) {
        return 1.0;
    }
    let depth = p.depth + select(p.depth, 1.0, is_sun) * DEPTH_ROUNDING;
    let scale = 1.0 / vec2f(textureDimensions(shadow_atlas));
    var lit = 0.0;
    lit += textureSampleCompareLevel(shadow_atlas, shadow_sampler, (p.texel + vec2f(-0.5, -0.5)) * scale, depth);
    lit += textureSampleCompareLevel(shadow_atlas, shadow_sampler, (p.texel + vec2f(0.5, -0.5)) * scale, depth);
    lit += textureSampleCompareLevel(shadow_atlas, shadow_sampler, (p.texel + vec2f(-0.5, 0.5)) * scale, depth);
    lit += textureSampleCompareLevel(shadow_atlas, shadow_sampler, (p.texel + vec2f(0.5, 0.5)) * scale, depth);
    return lit * 0.25;
}

const UNDECIDED: f32 = -1.0;

// Returns 1 if the texels around the point all show its own plane, 0 if all of them show something well before it, else
// UNDECIDED: a shadow's edge, a contact, or geometry finer than the texels.
//
// Over a plane, depth is linear in the texels, for suns and for perspective views.
fn shadow_verdict(light: u32, position: vec3f, normal: vec3f, to_light: vec3f) -> f32 {
    if (direct_lights[light].view_count == 0u) {
        return 1.0;
    }
    let index = shadow_view_at(light, position);
    let is_sun = direct_lights[light].kind == DIRECT_SUN;
    let clip_from_world = shadow_views[index].clip_from_world;
    let size = shadow_views[index].size;
    let clip = clip_from_world * vec4f(position, 1.0);
    if (clip.w <= 0.0 || abs(dot(normal, to_light)) < GRAZING) {
        return UNDECIDED;
    }
    let inverse_w = 1.0 / clip.w;
    let ndc = clip.xyz * inverse_w;
    let texel = (ndc.xy * vec2f(0.5, -0.5) + 0.5) * size;
    // How place and depth change along two directions of the plane, and so depth from texel to texel.
    let tangents = frame_from_normal(normal);
    let along0 = clip_from_world * vec4f(tangents[0], 0.0);
    let along1 = clip_from_world * vec4f(tangents[1], 0.0);
    let d0 = (along0.xyz - ndc * along0.w) * inverse_w;
    let d1 = (along1.xyz - ndc * along1.w) * inverse_w;
    let slope = vec2f(d0.z * d1.y - d1.z * d0.y, d1.z * d0.x - d0.z * d1.x) / (d0.x * d1.y - d1.x * d0.y)
        * vec2f(2.0, -2.0) / size;

    // A texel's width as a difference of depth.
    let unit = shadow_views[index].texel
        * select(ndc.z, length(vec3f(clip_from_world[0].z, clip_from_world[1].z, clip_from_world[2].z)), is_sun);
    let steep = unit + abs(slope.x) + abs(slope.y);
    let rounding = select(ndc.z, 1.0, is_sun) * DEPTH_ROUNDING;
    let own = OWN_PLANE * steep + rounding;
    let clear = CLEAR_OF_PLANE * steep + rounding;

    let atlas_size = vec2f(textureDimensions(shadow_atlas));
    let corner = floor(clamp(texel, vec2f(1.0), size - 1.0) - 0.5);
    let depths = textureGather(shadow_atlas, gather_sampler, (shadow_views[index].corner + corner + 1.0) / atlas_size);
    // Gathered are (0, 1), (1, 1), (1, 0), (0, 0).
    let offset = corner + 0.5 - texel;
    let plane = ndc.z + slope.x * (offset.x + vec4f(0.0, 1.0, 1.0, 0.0)) + slope.y * (offset.y + vec4f(1.0, 1.0, 0.0, 0.0));
    let above = depths - plane;
    if (all(abs(above) <= vec4f(own))) {
        return 1.0;
    }
    return select(UNDECIDED, 0.0, all(above > vec4f(clear)));
}
