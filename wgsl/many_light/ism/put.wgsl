// One invocation puts one block of texels that got a ray of its own into its map.
//
// In: the list of cells, the blocks' texels by cell of the list. Out: the atlas.
#import "many_light/ism/open_cells.wgsl"

@group(1) @binding(11) var<storage, read> open_cells: array<u32>;
@group(1) @binding(12) var<storage, read> open_groups: array<u32>;
@group(1) @binding(13) var<storage, read> blocks: array<vec4u>;
@group(1) @binding(14) var atlas: texture_storage_2d<r32uint, write>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let number = id.x / open_rows();
    if (number >= min(open_groups[3], arrayLength(&open_cells))) {
        return;
    }
    let cell = unpack_open_cell(open_cells[number]);
    let to = map_corner(cell.slot, textureDimensions(atlas).x) + cell.corner + vec2u(0u, id.x % open_rows() * BLOCK);
    for (var k = 0u; k < open_rows(); k += 1u) {
        let texels = blocks[id.x * open_rows() + k];
        let at = to + vec2u(k * BLOCK, 0u);
        textureStore(atlas, at, vec4u(texels.x));
        textureStore(atlas, at + vec2u(1u, 0u), vec4u(texels.y));
        textureStore(atlas, at + vec2u(0u, 1u), vec4u(texels.z));
        textureStore(atlas, at + vec2u(1u, 1u), vec4u(texels.w));
    }
}
