// The slices of the voxel grid: between the nearest and the farthest surface that the picture shows. As many for each
// doubling of the depth, within which they are of one thickness in 1 / depth: what `octaves` gives is close to a
// logarithm, at the cost of a conversion. Under parallel rays all are of one thickness. No ray between two visible
// surfaces leaves them.
#import "scene/info.wgsl"

override BITS: u32 = 128u;  // slices, one bit each, in words of 32

struct Slices {
    near: f32,      // view depths, metres
    far: f32,
    per_unit: f32,  // slices for each doubling of the depth (metre)
}

// Returns a number that grows with positive x, by 1 where x doubles: the bits of a float, exponent and mantissa.
fn octaves(x: f32) -> f32 {
    return f32(bitcast<i32>(x)) * (1.0 / 8388608.0);
}

fn octaves_of_four(x: vec4f) -> vec4f {
    return vec4f(bitcast<vec4i>(x)) * (1.0 / 8388608.0);
}

// Returns the slices of a range as `bounds.wgsl` leaves it: bits of the inverse nearest depth, and of the farthest.
fn slices_of(inverse_near: u32, far: u32) -> Slices {
    let near = 1.0 / max(bitcast<f32>(inverse_near), 1e-30);
    let parallel = view.orthographic != 0u;
    let farthest = bitcast<f32>(far);
    let span = select(octaves(1.0) - octaves(min(near / max(farthest, 1e-30), 1.0)), farthest - near, parallel);
    // The farthest surface is still in the last slice.
    return Slices(near, farthest, (f32(BITS) - 0.01) / max(span, 1e-30));
}

// Returns the slice of a depth, with its fraction.
fn slice_at(slices: Slices, depth: f32) -> f32 {
    let passed = octaves(1.0) - octaves(slices.near / max(depth, 1e-30));
    return slices.per_unit * select(passed, depth - slices.near, view.orthographic != 0u);
}
