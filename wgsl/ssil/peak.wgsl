// The brightest light of a bounce, and the value below which the bounce is skipped. Both are stored as bits: for
// positive floats, the order of the bits is that of the floats, so atomicMax works.

@group(1) @binding(13) var<storage, read_write> peak: array<atomic<u32>>;

fn raise_peak(value: f32) {
    let bits = bitcast<u32>(value);
    // A load is cheaper than an atomic maximum, and most values are not the largest.
    if (bits > atomicLoad(&peak[0])) {
        atomicMax(&peak[0], bits);
    }
}
