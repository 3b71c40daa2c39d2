// One invocation puts one texel that got a ray of its own into its map.
//
// In: the list of cells, texels by cell of the list. Out: the atlas.
#import "ism/map.wgsl"
#import "ism/open_cells.wgsl"

@group(1) @binding(11) var<storage, read> open_cells: array<u32>;
@group(1) @binding(12) var<storage, read> open_groups: array<u32>;
@group(1) @binding(13) var<storage, read> refined: array<u32>;
@group(1) @binding(14) var atlas: texture_storage_2d<r32uint, write>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let texel = open_texel(id.x, open_groups[3]);
    if (texel.cell == NO_CELL) {
        return;
    }
    let place = open_place(open_cells[texel.cell], texel.inside);
    textureStore(atlas, map_corner(place.slot) + place.at, vec4u(refined[id.x]));
}
