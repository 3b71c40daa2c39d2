// One fragment writes its triangle to the visibility buffer; the depth test keeps the nearest.
//
// Out: triangle and instance (NONE: the mesh lies in the world's tree) plus 1, so that 0 is no triangle; depth
// reversed, near / view depth. With PEEL, only fragments behind `nearer` pass: the next layer of depth peeling (Everitt
// 2001).
#import "shared/gbuffer/vertices.wgsl"
#import "shared/gbuffer/dither.wgsl"
#import "scene/hit_on_triangle.wgsl"
#import "scene/see_through.wgsl"

override PEEL: bool = false;

@group(1) @binding(11) var nearer: texture_2d<f32>;

fn is_nearer(clip: vec4f) -> bool {
    if (!PEEL) {
        return false;
    }
    return clip.z >= textureLoad(nearer, vec2i(clip.xy), 0).r;
}

struct Varyings {
    @builtin(position) clip: vec4f,
    @location(0) @interpolate(flat) ids: vec2u,  // triangle, instance
}

@vertex
fn vertex(@builtin(vertex_index) index: u32, @builtin(instance_index) slot: u32) -> Varyings {
    let v = raster_vertex(index, slot);
    return Varyings(view.clip_from_world * vec4f(v.position, 1.0), vec2u(v.triangle, v.instance));
}

@fragment
fn fragment(in: Varyings) -> @location(0) vec2u {
    if (is_nearer(in.clip)) {
        discard;
    }
    return in.ids + 1u;
}

struct MaskedVaryings {
    @builtin(position) clip: vec4f,
    @location(0) @interpolate(flat) ids: vec3u,  // triangle, instance, material
    @location(1) texcoords: vec4f,
    @location(2) alpha: f32,
}

@vertex
fn vertex_masked(@builtin(vertex_index) index: u32, @builtin(instance_index) slot: u32) -> MaskedVaryings {
    let v = raster_vertex(index, slot);
    let mask = mask_of_vertex(index, v.triangle);
    return MaskedVaryings(
        view.clip_from_world * vec4f(v.position, 1.0), vec3u(v.triangle, v.instance, mask.material), mask.texcoords,
        mask.alpha);
}

@fragment
fn fragment_masked(in: MaskedVaryings) -> @location(0) vec2u {
    let footprint = UvFootprint(
        dpdx(in.texcoords) * view.footprint, dpdy(in.texcoords) * view.footprint, view.anisotropy);
    if (is_nearer(in.clip) || is_open_over(Mask(in.texcoords, in.alpha, in.ids.z), footprint, false)) {
        discard;
    }
    return in.ids.xy + 1u;
}

// Of alpha-masked and see-through surfaces. Glass passes as much as `tint.wgsl` finds it to, at the pixel's point.
@fragment
fn fragment_see_through(in: MaskedVaryings) -> @location(0) vec2u {
    let footprint = UvFootprint(
        dpdx(in.texcoords) * view.footprint, dpdy(in.texcoords) * view.footprint, view.anisotropy);
    let mask = Mask(in.texcoords, in.alpha, in.ids.z);
    var is_open = is_nearer(in.clip);
    if (!is_see_through(mask.material)) {
        is_open = is_open || is_open_over(mask, footprint, false);
    } else {
        let pixel = vec2u(in.clip.xy);  // of the whole picture
        var chance: f32;
        if (HAS_TINTS && is_glass(mask.material)) {
            let ray = camera_ray(vec2f(pixel) + view.offset);
            let t = load_triangle(in.ids.x);
            chance = passage_of_hit(t, hit_on_triangle(ray, t, in.ids.x, in.ids.y), ray.direction, false).chance;
        } else {
            chance = 1.0 - base_alpha(
                mask.material, mask.alpha, mask.texcoords.xy, mask.texcoords.zw, footprint, false);
        }
        is_open = is_open || dither(pixel, in.ids.x) < chance;
    }
    if (is_open) {
        discard;
    }
    return in.ids.xy + 1u;
}
