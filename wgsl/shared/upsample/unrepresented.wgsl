// Read access to the list of unrepresented pixels; `shared/upsample/guide.wgsl` writes it.
#import "shared/upsample/list_group.wgsl"

@group(1) @binding(17) var<storage, read> unrepresented: array<u32>;         // pixels, by their index
@group(1) @binding(18) var<storage, read> unrepresented_groups: array<u32>;  // x, y, z workgroups; pixels

fn unrepresented_count() -> u32 {
    return unrepresented_groups[3];
}
