// One workgroup computes the depth range of its surfels. In: surfels. Out: the largest 1 / depth, 1/m, and the largest
// depth, m, as bits of positive floats.
#import "ssil/surfel.wgsl"

@group(1) @binding(11) var surfels: texture_storage_2d<rgba32uint, read>;
@group(1) @binding(12) var<storage, read_write> range: array<atomic<u32>>;

var<workgroup> largest_inverse: atomic<u32>;
var<workgroup> largest: atomic<u32>;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(local_invocation_index) thread: u32) {
    // WebGPU zeroes workgroup memory; wgpu-native 29 does not.
    if (thread == 0u) {
        atomicStore(&largest_inverse, 0u);
        atomicStore(&largest, 0u);
    }
    workgroupBarrier();
    let size = textureDimensions(surfels);
    if (all(id.xy < size)) {
        let texel = textureLoad(surfels, id.xy);
        if (!is_empty(texel)) {
            let depth = max(dot(surfel_position(texel), view.forward), 1e-30);
            atomicMax(&largest_inverse, bitcast<u32>(1.0 / depth));
            atomicMax(&largest, bitcast<u32>(depth));
        }
    }
    workgroupBarrier();
    if (thread == 0u && atomicLoad(&largest) != 0u) {
        atomicMax(&range[0], atomicLoad(&largest_inverse));
        atomicMax(&range[1], atomicLoad(&largest));
    }
}
