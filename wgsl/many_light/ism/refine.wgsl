// One invocation refines a row of blocks of a silhouette cell: it traces a ray through each block's centre.
//
// In: the list of cells, VPLs, scene. Out: the four texels of each block, by cell, row and column. Exact at
// the centre of a block; errs either way within it at silhouettes.
#import "many_light/ism/hit_triangle.wgsl"
#import "many_light/ism/silhouette_cells.wgsl"

@group(1) @binding(11) var<storage, read> silhouette_cells: array<u32>;
@group(1) @binding(12) var<storage, read_write> blocks: array<vec4u>;
@group(1) @binding(13) var<storage, read> refine_groups: array<u32>;  // workgroups x, y, z; cells

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let number = id.x / blocks_per_side();
    if (number >= refine_groups[3]) {
        return;
    }
    let cell = unpack_silhouette_cell(silhouette_cells[number]);
    let vpl = load_vpl(cell.slot);
    let frame = frame_from_normal(vpl.normal);
    let corner = cell.corner + vec2u(0u, id.x % blocks_per_side() * BLOCK);
    let first = id.x * blocks_per_side();
    for (var k = 0u; k < blocks_per_side(); k += 1u) {
        let at = corner + vec2u(k * BLOCK, 0u);
        let centre = vec2f(at) + 0.5 * f32(BLOCK);
        let triangle = trace_triangle(vpl, frame, ray_direction(centre));
        blocks[first + k] = block_texels(map_direction(centre), triangle.plane);
    }
}
