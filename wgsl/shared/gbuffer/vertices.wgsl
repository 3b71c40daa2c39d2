// Vertex pulling for raster passes: positions that carry their triangle's number, and the attributes of the alpha test.
#import "scene/corners.wgsl"

@group(1) @binding(30) var<storage, read> raster_vertices: array<vec4u>;  // position, as float bits; triangle
@group(1) @binding(31) var<storage, read> raster_sources: array<u32>;     // entries of the table of vertices
@group(1) @binding(32) var<storage, read> raster_slots: array<u32>;       // scene instance of each instance slot

struct RasterVertex {
    position: vec3f,  // metres relative to the scene's origin
    triangle: u32,    // valid for a triangle's first vertex
    instance: u32,    // that transforms it; NONE: it is in world space
}

fn raster_vertex(index: u32, slot: u32) -> RasterVertex {
    let texel = raster_vertices[index];
    var v = RasterVertex(bitcast<vec3f>(texel.xyz), texel.w, NONE);
    if (HAS_INSTANCES) {
        v.instance = raster_slots[slot];
        if (v.instance != NONE) {
            v.position = instances[v.instance].world_from_local * vec4f(v.position, 1.0);
        }
    }
    return v;
}

// Inputs of the alpha test, interpolated over the triangle; the material is flat.
struct Mask {
    texcoords: vec4f,  // both sets
    alpha: f32,        // of the vertex colours
    material: u32,
}

fn mask_of_vertex(index: u32, triangle: u32) -> Mask {
    let v = load_vertex(raster_sources[index]);
    return Mask(vec4f(v.texcoord0, v.texcoord1), unpack_color(v.color).a, load_triangle(triangle).material);
}

// Returns whether a fragment is cut out at its centre.
fn is_open(mask: Mask) -> bool {
    return is_open_over(mask, UvFootprint(vec4f(0.0), vec4f(0.0), 1.0), true);
}

// Returns whether a fragment is cut out by the mean alpha of a footprint, or at its centre.
fn is_open_over(mask: Mask, footprint: UvFootprint, is_point: bool) -> bool {
    return base_alpha(mask.material, mask.alpha, mask.texcoords.xy, mask.texcoords.zw, footprint, is_point)
        < materials[mask.material].alpha_cutoff;
}
