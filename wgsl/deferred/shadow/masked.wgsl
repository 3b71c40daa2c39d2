// One fragment of an alpha-masked surface writes its depth to a shadow view, unless its bilinear alpha is below the
// material's cutoff; with SEE_THROUGH_ONLY, one of a see-through surface that is not fully open. Out: depth, reversed.
#import "deferred/shadow/vertices.wgsl"
#import "scene/see_through.wgsl"

override SEE_THROUGH_ONLY: bool = false;

struct Varyings {
    @builtin(position) clip: vec4f,
    @location(0) texcoords: vec4f,
    @location(1) alpha: f32,
    @location(2) @interpolate(flat) material: u32,
}

@vertex
fn vertex(@builtin(vertex_index) index: u32, @builtin(instance_index) slot: u32) -> Varyings {
    let mask = mask_of_vertex(index, raster_vertices[index].w);
    return Varyings(shadow_vertex(index, slot), mask.texcoords, mask.alpha, mask.material);
}

@fragment
fn fragment(in: Varyings) {
    let mask = Mask(in.texcoords, in.alpha, in.material);
    if (SEE_THROUGH_ONLY || passes_shadow_rays(in.material)) {
        let alpha = base_alpha(
            mask.material, mask.alpha, mask.texcoords.xy, mask.texcoords.zw,
            UvFootprint(vec4f(0.0), vec4f(0.0), 1.0), true);
        let is_blank = cover(in.material, alpha) <= 0.0;
        if (!SEE_THROUGH_ONLY || !passes_shadow_rays(in.material) || is_blank) {
            discard;
        }
    } else if (is_open(mask)) {
        discard;
    }
}
