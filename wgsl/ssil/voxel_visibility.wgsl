// Visibility between two endpoints by voxels.
#import "ssil/endpoint.wgsl"
#import "ssil/voxels/march.wgsl"

var<private> lifted_start: vec3f;

fn prepare(start: Endpoint) {
    prepare_march();
    lifted_start = lifted(start.position, start.normal);
}

fn visibility(start: Endpoint, end: Endpoint, number: u32) -> vec3f {
    return vec3f(march(lifted_start, lifted(end.position, end.normal), fract(f32(number) * 0.618034)));
}
