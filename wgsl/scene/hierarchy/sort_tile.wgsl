// What the passes of the radix sort share: a workgroup sorts a tile, each thread holds consecutive pairs of it.
//
// Least significant digit first, 4 bits a pass (Satish et al. 2009, "Designing Efficient Sorting Algorithms for Manycore
// GPUs"). Departure: no local sort before the scatter.
struct Digit {
    shift: u32,
}

@group(1) @binding(0) var<uniform> params: Digit;
@group(1) @binding(1) var<storage, read> pairs: array<vec2u>;
@group(1) @binding(2) var<storage, read_write> counts: array<u32>;  // by digit, then by tile

const THREADS: u32 = 256u;
const HELD: u32 = 8u;       // pairs of a thread
const DIGITS: u32 = 16u;

fn digit_of(key: u32) -> u32 {
    return (key >> params.shift) & (DIGITS - 1u);
}

fn tile_count() -> u32 {
    return arrayLength(&counts) / DIGITS;
}
