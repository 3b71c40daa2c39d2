// One fragment of an alpha-masked surface writes its depth to a shadow view, unless its bilinear alpha is below the
// material's cutoff. Out: depth, reversed.
#import "deferred/shadow/vertices.wgsl"

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
    if (is_open(Mask(in.texcoords, in.alpha, in.material))) {
        discard;
    }
}
