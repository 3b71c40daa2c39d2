// One invocation copies a row of refined blocks of a silhouette cell into the map.
//
// This is a separate pass, because WebGPU's default limit is four storage textures per stage and tracing reads four.
// In: the list of cells, the texels of their blocks. Out: the atlas. Exact.
#import "many_light/ism/silhouette_cells.wgsl"

@group(1) @binding(11) var<storage, read> silhouette_cells: array<u32>;
@group(1) @binding(12) var<storage, read> refine_groups: array<u32>;  // workgroups x, y, z; cells
@group(1) @binding(13) var<storage, read> blocks: array<vec4u>;       // texels, by cell, row and column
@group(1) @binding(14) var atlas: texture_storage_2d<r32uint, write>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let number = id.x / blocks_per_side();
    if (number >= refine_groups[3]) {
        return;
    }
    let cell = unpack_silhouette_cell(silhouette_cells[number]);
    let row = vec2u(0u, id.x % blocks_per_side() * BLOCK);
    let to = map_corner(cell.slot, textureDimensions(atlas).x) + cell.corner + row;
    for (var k = 0u; k < blocks_per_side(); k += 1u) {
        let texels = blocks[id.x * blocks_per_side() + k];
        let at = to + vec2u(k * BLOCK, 0u);
        textureStore(atlas, at, vec4u(texels.x));
        textureStore(atlas, at + vec2u(1u, 0u), vec4u(texels.y));
        textureStore(atlas, at + vec2u(0u, 1u), vec4u(texels.z));
        textureStore(atlas, at + vec2u(1u, 1u), vec4u(texels.w));
    }
}
