// The slices of the voxel grid: between the nearest and the farthest surface that the picture shows, all of one
// thickness over their depth (of one thickness under parallel rays). No ray between two visible surfaces leaves them.
#import "scene/info.wgsl"

override BITS: u32 = 128u;  // slices, one bit each, in words of 32

struct Slices {
    near: f32,      // view depth, metres
    per_unit: f32,  // slices for each doubling of the depth (metre)
}

// Returns the slices of a range as `bounds.wgsl` leaves it: bits of the inverse nearest depth, and of the farthest.
fn slices_of(inverse_near: u32, far: u32) -> Slices {
    let near = 1.0 / max(bitcast<f32>(inverse_near), 1e-30);
    let parallel = view.orthographic != 0u;
    let span = select(log2(max(bitcast<f32>(far) / near, 1.0)), bitcast<f32>(far) - near, parallel);
    // The farthest surface is still in the last slice.
    return Slices(near, (f32(BITS) - 0.01) / max(span, 1e-30));
}

// Returns the slice of a depth, with its fraction.
fn slice_at(slices: Slices, depth: f32) -> f32 {
    let ratio = log2(max(depth / slices.near, 1e-30));
    return slices.per_unit * select(ratio, depth - slices.near, view.orthographic != 0u);
}
