// One invocation finds one texel of a cell that the rays at its corners leave open, by a ray of its own.
//
// In: the list of such cells, VPLs, the scene. Out: texels, by cell of the list.
#import "ism/facet.wgsl"
#import "ism/open_cells.wgsl"

@group(1) @binding(11) var<storage, read> open_cells: array<u32>;
@group(1) @binding(12) var<storage, read> open_groups: array<u32>;
@group(1) @binding(13) var<storage, read_write> refined: array<u32>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let texel = open_texel(id.x, open_groups[3]);
    if (texel.cell == NO_CELL) {
        return;
    }
    let place = open_place(open_cells[texel.cell], texel.inside);
    let w = map_direction(vec2f(place.at) + 0.5);
    let vpl = load_vpl(place.slot);
    var found = 0u;
    if (w.z > 0.0 && max3(vpl.flux) > 0.0) {
        found = plane_texel(w, facet_met(vpl, w).plane);
    }
    refined[id.x] = found;
}
