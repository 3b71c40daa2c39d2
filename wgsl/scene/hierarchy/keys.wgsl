// Each invocation computes the Morton code of a triangle's centre, 20 bits an axis, in the cube around its mesh.
//
// Morton 1966; Karras 2012, "Maximizing Parallelism in the Construction of BVHs", section 2. In: positions in metres,
// corners. Out: the code's low 30 bits with the triangle's number, ready to be sorted, and its high 30 bits.
#import "scene/hierarchy/triangles.wgsl"

@group(1) @binding(4) var<storage, read_write> pairs: array<vec2u>;  // key, triangle
@group(1) @binding(5) var<storage, read_write> high_keys: array<u32>;

const LAST_CELL: f32 = 1048575.0;

// Spreads 10 bits, two zeros after each.
fn spread(value: u32) -> u32 {
    var v = value & 0x3ffu;
    v = (v | (v << 16u)) & 0x030000ffu;
    v = (v | (v << 8u)) & 0x0300f00fu;
    v = (v | (v << 4u)) & 0x030c30c3u;
    return (v | (v << 2u)) & 0x09249249u;
}

fn interleave(cell: vec3u) -> u32 {
    return (spread(cell.x) << 2u) | (spread(cell.y) << 1u) | spread(cell.z);
}

@compute @workgroup_size(256)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let i = id.x;
    if (i >= arrayLength(&pairs)) {
        return;
    }
    let box = triangle_box(i);
    let frame = frames[tree_of(i)];
    let centre = 0.5 * box.low + 0.5 * box.high;
    let cell = vec3u(clamp((centre - frame.low) * frame.cells, vec3f(0.0), vec3f(LAST_CELL)));
    pairs[i] = vec2u(interleave(cell), i);
    high_keys[i] = interleave(cell >> vec3u(10u));
}
