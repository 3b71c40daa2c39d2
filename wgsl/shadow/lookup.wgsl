// How much of a light arrives at a point, by the shadow maps: percentage-closer filtering (Reeves et al. 1987).
//
// The point is moved off its surface by as much as the filter's texels may lie below it, so the bias is in texels and
// by slope, not in metres. Errs bright within about two texels of a contact, and soft by a texel at a shadow's edge.
#import "shadow/views.wgsl"

@group(1) @binding(25) var<storage, read> direct_lights: array<DirectLight>;
@group(1) @binding(26) var<storage, read> shadow_views: array<ShadowView>;
@group(1) @binding(27) var shadow_atlas: texture_depth_2d;
@group(1) @binding(28) var shadow_sampler: sampler_comparison;

// The filter reaches 1.5 texels to each side of the point, and the nearest texel centre half a texel more.
const FILTER_REACH: f32 = 2.0;
// Of the depth: rounding of float32 in the projection and of the interpolation by rasterisation. Chosen.
const DEPTH_ROUNDING: f32 = 4e-6;

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

// Returns the share of the filter that sees the light, 0 to 1. `normal` is geometric and `to_light` unit.
fn shadow_filter(light: u32, position: vec3f, normal: vec3f, to_light: vec3f) -> f32 {
    if (direct_lights[light].view_count == 0u) {
        return 1.0;
    }
    let index = shadow_view_at(light, position);
    let is_sun = direct_lights[light].kind == DIRECT_SUN;
    let clip_from_world = shadow_views[index].clip_from_world;
    let corner = shadow_views[index].corner;
    let size = shadow_views[index].size;
    let along = (clip_from_world * vec4f(position, 1.0)).w;
    let footprint = shadow_views[index].texel * select(along, 1.0, is_sun);
    let cosine = dot(normal, to_light);
    let sine = sqrt(max(1.0 - cosine * cosine, 0.0));
    let side = select(-1.0, 1.0, cosine >= 0.0);
    let clip = clip_from_world * vec4f(position + normal * (side * FILTER_REACH * footprint * sine), 1.0);
    if (clip.w <= 0.0) {
        return 1.0;
    }
    let ndc = clip.xyz / clip.w;
    let texel = corner + clamp((ndc.xy * vec2f(0.5, -0.5) + 0.5) * size, vec2f(1.0), size - 1.0);
    let depth = ndc.z + select(ndc.z, 1.0, is_sun) * DEPTH_ROUNDING;
    let scale = 1.0 / vec2f(textureDimensions(shadow_atlas));
    var lit = 0.0;
    lit += textureSampleCompareLevel(shadow_atlas, shadow_sampler, (texel + vec2f(-0.5, -0.5)) * scale, depth);
    lit += textureSampleCompareLevel(shadow_atlas, shadow_sampler, (texel + vec2f(0.5, -0.5)) * scale, depth);
    lit += textureSampleCompareLevel(shadow_atlas, shadow_sampler, (texel + vec2f(-0.5, 0.5)) * scale, depth);
    lit += textureSampleCompareLevel(shadow_atlas, shadow_sampler, (texel + vec2f(0.5, 0.5)) * scale, depth);
    return lit * 0.25;
}
