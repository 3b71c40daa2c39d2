// Visibility between two places by voxels.
#import "ssil/place.wgsl"
#import "ssil/voxels/march.wgsl"

var<private> lifted_start: vec3f;

fn prepare(start: Place) {
    prepare_march();
    lifted_start = lifted(start.position, start.normal);
}

fn visibility(start: Place, end: Place, number: u32) -> f32 {
    return march(lifted_start, lifted(end.position, end.normal), fract(f32(number) * 0.618034));
}
