// Visibility between two places by voxels.
#import "ssil/place.wgsl"
#import "voxels/march.wgsl"

fn prepare() {
    prepare_march();
}

fn visibility(start: Place, end: Place, number: u32) -> f32 {
    let jitter = fract(f32(number) * 0.618034);
    return march(
        start.pixel, dot(start.position, view.forward), end.pixel, dot(end.position, view.forward), jitter);
}
