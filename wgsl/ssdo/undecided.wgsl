// The list of directions that the pictures do not decide: each may hit something off-screen. A pass over it
// traces them.
//
// A search stores UNKNOWN_HIT and the packed direction in `hits`, and lists the index of that entry. Entries of one pixel
// follow one another in the list; pixels come in no particular order.
#import "shared/upsample/list_group.wgsl"

// Workgroups along x, y and z; listed directions; directions searched in all; then the list.
@group(1) @binding(15) var<storage, read_write> undecided: array<atomic<u32>>;

const LIST_START: u32 = 8u;  // words before the list

// Makes room for `count` undecided directions of a pixel, which searches `searched` in all. Returns their first place.
fn reserve_undecided(count: u32, searched: u32) -> u32 {
    atomicAdd(&undecided[4], searched);
    if (count == 0u) {
        return 0u;
    }
    let place = atomicAdd(&undecided[3], count);
    atomicMax(&undecided[0], min((place + count - 1u) / LIST_GROUP + 1u, MAX_LIST_GROUPS));
    atomicStore(&undecided[1], 1u);
    atomicStore(&undecided[2], 1u);
    return place;
}

// Lists a direction; `index`: of its entry in `hits`.
fn list_undecided(place: u32, index: u32) {
    atomicStore(&undecided[LIST_START + place], index);
}
