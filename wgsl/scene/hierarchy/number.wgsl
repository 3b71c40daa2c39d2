// The numbering of wide nodes: in reverse order of creation, so that parents come before their children.
struct Wide {
    levels: u32,
    first: u32,
}

@group(1) @binding(0) var<storage, read_write> wide: array<Wide>;  // `levels` becomes the number

const THREADS: u32 = 256u;

fn inner_at(place: u32) -> u32 {
    return arrayLength(&wide) - 1u - place;
}

fn is_wide(place: u32) -> bool {
    return place < arrayLength(&wide) && wide[inner_at(place)].levels > 0u;
}
