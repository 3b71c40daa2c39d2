// One invocation writes the workgroups of `tiles.wgsl`: one for each listed tile.
//
// In: the number of listed tiles, which exceeds their entries if the list is full. Out: workgroups along x, y and z.

@group(1) @binding(13) var<storage, read> cells: array<u32>;
@group(1) @binding(15) var<storage, read_write> groups: array<u32>;
@group(1) @binding(19) var<uniform> params: Params;

struct Params {
    list: u32,   // word of the number
    most: u32,   // entries of the list
}

@compute @workgroup_size(1)
fn main() {
    groups[0] = min(cells[params.list], params.most);
    groups[1] = 1u;
    groups[2] = 1u;
}
