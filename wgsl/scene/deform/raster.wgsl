// One invocation writes the position of a vertex of raster passes that belongs to a deformed mesh.
//
// In: posed vertices. Out: the first three words of raster vertices (`shared/gbuffer/vertices.wgsl`).
#import "scene/deform/mesh.wgsl"

@group(1) @binding(2) var<storage, read> raster_sources: array<u32>;
@group(1) @binding(3) var<storage, read_write> raster_vertices: array<vec4u>;

@compute @workgroup_size(256)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (id.x >= params.count) {
        return;
    }
    let index = params.first + id.x;
    let position = posed_position(raster_sources[index]);
    raster_vertices[index] = vec4u(bitcast<vec3u>(position), raster_vertices[index].w);
}
