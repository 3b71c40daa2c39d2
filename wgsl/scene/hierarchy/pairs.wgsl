// Which clusters merge: those that are each other's nearest. Each thread decides on PLACES consecutive ones.
#import "scene/hierarchy/clusters.wgsl"

@group(1) @binding(0) var<storage, read> state: State;
@group(1) @binding(1) var<storage, read> nearest: array<u32>;

const THREADS: u32 = 256u;
const PLACES: u32 = 4u;
const REMAINS: u32 = 1u;
const MERGES: u32 = 0x10001u;  // with the cluster behind it, and takes the place of both

fn outcome_of(i: u32) -> u32 {
    if (i >= state.count) {
        return 0u;
    }
    let other = nearest[i];
    if (other == ALONE) {
        return 0u;
    }
    if (other == NONE || nearest[other] != i) {
        return REMAINS;
    }
    return select(0u, MERGES, i < other);
}
