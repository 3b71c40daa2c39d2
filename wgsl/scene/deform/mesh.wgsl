// The tables of deformed meshes in buffers, which are copied into the scene's textures (`scene/geometry.wgsl`).
//
// References within them count from the start of the scene's tables, the buffers from the first deformed mesh.

struct Range {
    first: u32,          // element of the buffer
    count: u32,
    first_node: u32,     // of the scene's tables: where the buffers begin
    first_triangle: u32,
    first_vertex: u32,
    grid_low: vec3f,     // of the grid of node boxes, metres
    grid_scale: vec3f,   // steps per metre
}

@group(1) @binding(0) var<uniform> params: Range;
@group(1) @binding(1) var<storage, read> posed: array<vec4f>;  // metres, local

fn posed_position(vertex: u32) -> vec3f {
    return posed[vertex - params.first_vertex].xyz;
}
