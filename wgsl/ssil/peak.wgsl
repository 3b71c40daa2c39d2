// The brightest light of a bounce, and the threshold below which light counts as none: bits of positive floats, which
// have the floats' order.

@group(1) @binding(13) var<storage, read_write> peak: array<atomic<u32>>;

fn raise_peak(value: f32) {
    let bits = bitcast<u32>(value);
    // A load is cheaper than an atomic maximum, and most values are not the largest.
    if (bits > atomicLoad(&peak[0])) {
        atomicMax(&peak[0], bits);
    }
}
