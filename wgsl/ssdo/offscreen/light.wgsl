// One invocation looks up the radiance that arrives along an undecided direction from an off-screen hit:
// L = rho E_cell / pi.
//
// In: hits, cells of the radiance cache, the list of undecided directions. Out: L in the entries of `hits`, W/(m2 sr),
// 8 bits a channel. Errs blurry, by the side of a cell; hits reflect as if they were matte.
#import "shared/radiance_cache/cells.wgsl"
#import "shared/radiance_cache/hits.wgsl"
#import "ssdo/hit_code.wgsl"
#import "shared/upsample/list_group.wgsl"

@group(1) @binding(13) var<storage, read_write> hits: array<vec2u>;  // packed by `ssdo/hit_code.wgsl`
@group(1) @binding(15) var<storage, read> undecided: array<u32>;
@group(1) @binding(24) var<storage, read> cache_hits: array<CacheHit>;
@group(1) @binding(25) var<storage, read> cells: array<Cell>;

const LIST_START: u32 = 8u;  // words before the list

@compute @workgroup_size(LIST_GROUP)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let count = undecided[3];
    for (var place = id.x; place < count; place += groups.x * LIST_GROUP) {
        let index = undecided[LIST_START + place];
        let found = cache_hits[index];
        if (found.triangle != NONE && found.cell != NO_CELL) {
            let radiance = unpack_reflectance(found.reflectance) * cells[found.cell].irradiance * INV_PI;
            hits[index].x = pack_radiance(radiance);
        }
    }
}
