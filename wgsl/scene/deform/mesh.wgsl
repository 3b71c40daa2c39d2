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

const ANCHOR_WORD: u32 = 0u;  // words of a triangle, 16 in all
const EDGE1_WORD: u32 = 4u;
const EDGE2_WORD: u32 = 8u;
const FLAGS_WORD: u32 = 11u;
const CORNERS_WORD: u32 = 12u;

@group(1) @binding(0) var<uniform> params: Range;
@group(1) @binding(1) var<storage, read> posed: array<f32>;  // 3 a vertex, metres

fn posed_position(vertex: u32) -> vec3f {
    let at = 3u * (vertex - params.first_vertex);
    return vec3f(posed[at], posed[at + 1u], posed[at + 2u]);
}
