// One invocation finds a row of blocks of a cell that the rays at its corners leave open, by a ray through each.
//
// In: the list of such cells, VPLs, the scene. Out: the blocks' texels, by cell of the list.
#import "many_light/ism/facet.wgsl"
#import "many_light/ism/open_cells.wgsl"

@group(1) @binding(11) var<storage, read> open_cells: array<u32>;
@group(1) @binding(12) var<storage, read_write> blocks: array<vec4u>;
@group(1) @binding(13) var<storage, read> open_groups: array<u32>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let number = id.x / open_rows();
    if (number >= min(open_groups[3], arrayLength(&open_cells))) {
        return;
    }
    let cell = unpack_open_cell(open_cells[number]);
    let vpl = load_vpl(cell.slot);
    let frame = frame_from_normal(vpl.normal);
    let corner = cell.corner + vec2u(0u, id.x % open_rows() * BLOCK);
    let first = id.x * open_rows();
    for (var k = 0u; k < open_rows(); k += 1u) {
        let at = corner + vec2u(k * BLOCK, 0u);
        let centre = vec2f(at) + 0.5 * f32(BLOCK);
        let facet = trace_facet(vpl, frame, ray_direction(centre));
        blocks[first + k] = block_texels(map_direction(centre), facet.plane);
    }
}
