// The slices of the voxel grid, between the nearest and the farthest visible surface: all segments between visible
// surfaces stay within them.
//
// In perspective every doubling of the depth has the same number of slices, equally thick in 1 / depth. `octaves` is
// close to a logarithm and costs one conversion. Under parallel rays all slices are equally thick.
#import "scene/info.wgsl"

override SLICES: u32 = 128u;  // slices, one bit each, in words of 32

struct Slices {
    near: f32,      // view depths, metres
    far: f32,
    per_unit: f32,  // slices per doubling of the depth, or per metre under parallel rays
}

// Returns the bits of a positive float over 2^23: exponent plus mantissa, which grows by 1 where x doubles.
fn octaves(x: f32) -> f32 {
    return f32(bitcast<i32>(x)) * (1.0 / 8388608.0);
}

fn octaves_of_four(x: vec4f) -> vec4f {
    return vec4f(bitcast<vec4i>(x)) * (1.0 / 8388608.0);
}

// Returns the slices of a range from `depth_range.wgsl`: bits of the largest 1 / depth, and of the largest depth.
fn slices_of(inverse_near: u32, far: u32) -> Slices {
    let near = 1.0 / max(bitcast<f32>(inverse_near), 1e-30);
    let parallel = view.orthographic != 0u;
    let farthest = bitcast<f32>(far);
    let span = select(octaves(1.0) - octaves(min(near / max(farthest, 1e-30), 1.0)), farthest - near, parallel);
    // Keep the farthest surface in the last slice.
    return Slices(near, farthest, (f32(SLICES) - 0.01) / max(span, 1e-30));
}

// Returns the slice of a depth, with its fraction.
fn slice_at(slices: Slices, depth: f32) -> f32 {
    let passed = octaves(1.0) - octaves(slices.near / max(depth, 1e-30));
    return slices.per_unit * select(passed, depth - slices.near, view.orthographic != 0u);
}
