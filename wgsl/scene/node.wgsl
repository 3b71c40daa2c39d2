// The test of a ray against a node's children.
//
// The ray is transformed to the grid of the node's tree once; a node's frame lies on that grid (`geometry.wgsl`). Ylitie
// et al. 2017, "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs", section 3.
#import "scene/geometry.wgsl"
#import "common/math.wgsl"

// The ray in the grid of a hierarchy: it reaches the slab at integer q at the distance q * inverse + offset.
struct GridRay {
    inverse: vec3f,
    offset: vec3f,
}

// Three roundings of a slab's distance may put the exit of a flat box before its entry (Ize 2013, "Robust BVH Ray
// Traversal").
const SLACK: f32 = 1.0000004;

fn grid_ray(origin: vec3f, direction: vec3f, low: vec3f, scale: vec3f) -> GridRay {
    // A zero component would make 0 * inf = NaN; with 1e-20 the ray never leaves the slab that it starts in.
    let scaled = direction * scale;
    let guarded = select(scaled, vec3f(1e-20), abs(scaled) < vec3f(1e-20));
    let inverse = 1.0 / guarded;
    return GridRay(inverse, (low - origin) * scale * inverse);
}

fn codes(word: u32) -> vec4f {
    return vec4f((vec4u(word) >> vec4u(0u, 8u, 16u, 24u)) & vec4u(255u));
}

// Returns the children of a node that the ray meets nearer than `limit`, nearest first: each number is a child's, 0..3,
// with the entry's distance in the bits above; NONE stands for no child.
fn meet_children(node: Node, grid: GridRay, limit: f32) -> vec4u {
    // Distances to the node's origin, and of a step.
    let corner = vec3f(vec3u(node.frame.x, node.frame.x >> 16u, node.frame.y) & vec3u(0xffffu));
    let shifts = (vec3u(node.frame.y) >> vec3u(16u, 20u, 24u)) & vec3u(15u);
    let step = bitcast<vec3f>((shifts + vec3u(127u)) << vec3u(23u)) * grid.inverse;
    let start = fma(corner, grid.inverse, grid.offset);
    // The ray enters through the lower side where it goes up.
    let x = select(node.x, node.x.yx, grid.inverse.x < 0.0);
    let y = select(node.y, node.y.yx, grid.inverse.y < 0.0);
    let z = select(node.z, node.z.yx, grid.inverse.z < 0.0);
    let enter_x = fma(codes(x.x), vec4f(step.x), vec4f(start.x));
    let enter_y = fma(codes(y.x), vec4f(step.y), vec4f(start.y));
    let enter_z = fma(codes(z.x), vec4f(step.z), vec4f(start.z));
    let leave_x = fma(codes(x.y), vec4f(step.x), vec4f(start.x));
    let leave_y = fma(codes(y.y), vec4f(step.y), vec4f(start.y));
    let leave_z = fma(codes(z.y), vec4f(step.z), vec4f(start.z));
    // Compared as integers, floats keep their order unless both are negative; then the entry becomes 0, and the exit
    // stays negative. CPU drivers take three instructions for the minimum of two floats, one for that of integers.
    let enter = max(max(bitcast<vec4i>(enter_x), bitcast<vec4i>(enter_y)), max(bitcast<vec4i>(enter_z), vec4i(0)));
    let exit = min(min(bitcast<vec4i>(leave_x), bitcast<vec4i>(leave_y)), bitcast<vec4i>(leave_z));
    let leave = min(bitcast<vec4i>(bitcast<vec4f>(exit) * SLACK), vec4i(bitcast<i32>(limit)));
    let keys = select(vec4u(NONE), (bitcast<vec4u>(enter) & vec4u(~3u)) | vec4u(0u, 1u, 2u, 3u), enter <= leave);
    // Sort them with a network of five comparisons.
    let low = min(keys.xz, keys.yw);
    let high = max(keys.xz, keys.yw);
    let middle = vec2u(max(low.x, low.y), min(high.x, high.y));
    return vec4u(min(low.x, low.y), min(middle.x, middle.y), max(middle.x, middle.y), max(high.x, high.y));
}

// Returns the numbers of the second to the fourth child of a list in its lowest bits, two each, above them a 1.
fn pack_rest(order: vec4u) -> u32 {
    let numbers = order & vec4u(3u);
    let two = select(1u, 4u | numbers.y, order.y != NONE);
    let three = select(two, 16u | (numbers.z << 2u) | numbers.y, order.z != NONE);
    return select(three, 64u | (numbers.w << 4u) | (numbers.z << 2u) | numbers.y, order.w != NONE);
}
