// The list of pixels that no pixel of the grid of every other one stands for: those are searched for by themselves.
#import "ssdo/rest_group.wgsl"

@group(1) @binding(17) var<storage, read> rest: array<u32>;         // pixels, by their index
@group(1) @binding(18) var<storage, read> rest_groups: array<u32>;  // x, y, z workgroups; pixels

fn rest_count() -> u32 {
    return rest_groups[3];
}
