// One invocation refits a node: it boxes its children, and quantises the boxes as `upload/node_quantization.py` does.
//
// In: the nodes of one level, the last level first; posed vertices; the unions of the boxes of lower levels. Out: frames
// and codes of the nodes, and the union of each node's boxes. Boxes are rounded outwards: rays miss nothing.
#import "scene/deform/mesh.wgsl"

@group(1) @binding(2) var<storage, read> triangles: array<u32>;
@group(1) @binding(3) var<storage, read_write> nodes: array<u32>;  // 12 a node
@group(1) @binding(4) var<storage, read_write> unions: array<vec4f>;  // low and high corner by node, metres

const LEAF: u32 = 0x80000000u;
const LAST_STEP: f32 = 65280.0;
const LAST_CODE: u32 = 255u;
const MAX_SHIFT: u32 = 8u;
// Grid steps added before rounding: those of `upload/node_quantization.py`, and as much again as float32 errs here, by
// 4 units of 65536 x 2^-24.
const PAD: f32 = 0.0625 + 0.03125;

struct Box {
    low: vec3f,
    high: vec3f,
}

fn leaf_box(reference: u32) -> Box {
    var box = Box(vec3f(3e38), vec3f(-3e38));
    let first = 16u * ((reference & 0x0fffffffu) - params.first_triangle) + CORNERS_WORD;
    let end = first + 16u * ((reference >> 28u) & 7u);
    for (var record = first; record < end; record += 16u) {
        for (var k = 0u; k < 3u; k += 1u) {
            let position = posed_position(triangles[record + k]);
            box.low = min(box.low, position);
            box.high = max(box.high, position);
        }
    }
    return box;
}

// Returns the least shift with which an extent in steps fits into 8 bits.
fn shift_of(extent: u32) -> u32 {
    var shift = 0u;
    for (var s = 0u; s < MAX_SHIFT; s += 1u) {
        shift += select(0u, 1u, (extent + (1u << s) - 1u) >> s > LAST_CODE);
    }
    return shift;
}

// Returns the low and high codes of four children along an axis.
fn codes_of(low: vec4u, high: vec4u, origin: u32, shift: u32, exists: vec4<bool>) -> vec2u {
    let bits = vec4u(0u, 8u, 16u, 24u);
    let lows = select(vec4u(LAST_CODE), (low - origin) >> vec4u(shift), exists) << bits;
    let highs = select(vec4u(0u), (high - origin + (1u << shift) - 1u) >> vec4u(shift), exists) << bits;
    return vec2u(lows.x | lows.y | lows.z | lows.w, highs.x | highs.y | highs.z | highs.w);
}

@compute @workgroup_size(256)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (id.x >= params.count) {
        return;
    }
    let node = params.first + id.x;
    let record = 12u * node;
    // Box the children, in metres and in steps of the grid; absent ones have the last step below and 0 above.
    var whole = Box(vec3f(3e38), vec3f(-3e38));
    var low: array<vec3u, 4>;
    var high: array<vec3u, 4>;
    var exists: array<bool, 4>;
    for (var k = 0u; k < 4u; k += 1u) {
        let reference = nodes[record + 8u + k];
        exists[k] = reference != LEAF;
        low[k] = vec3u(u32(LAST_STEP));
        high[k] = vec3u(0u);
        if (exists[k]) {
            var box: Box;
            if ((reference & LEAF) != 0u) {
                box = leaf_box(reference);
            } else {
                let child = 2u * (reference - params.first_node);
                box = Box(unions[child].xyz, unions[child + 1u].xyz);
            }
            whole = Box(min(whole.low, box.low), max(whole.high, box.high));
            let start = floor((box.low - params.grid_low) * params.grid_scale - PAD);
            let end = ceil((box.high - params.grid_low) * params.grid_scale + PAD);
            low[k] = vec3u(clamp(start, vec3f(0.0), vec3f(LAST_STEP)));
            high[k] = vec3u(clamp(end, vec3f(0.0), vec3f(LAST_STEP)));
        }
    }
    unions[2u * node] = vec4f(whole.low, 0.0);
    unions[2u * node + 1u] = vec4f(whole.high, 0.0);
    // Write the frame, and the codes in it.
    let origin = min(min(low[0], low[1]), min(low[2], low[3]));
    let extent = max(max(high[0], high[1]), max(high[2], high[3])) - origin;
    let shift = vec3u(shift_of(extent.x), shift_of(extent.y), shift_of(extent.z));
    let there = vec4<bool>(exists[0], exists[1], exists[2], exists[3]);
    let x = codes_of(vec4u(low[0].x, low[1].x, low[2].x, low[3].x), vec4u(high[0].x, high[1].x, high[2].x, high[3].x),
        origin.x, shift.x, there);
    let y = codes_of(vec4u(low[0].y, low[1].y, low[2].y, low[3].y), vec4u(high[0].y, high[1].y, high[2].y, high[3].y),
        origin.y, shift.y, there);
    let z = codes_of(vec4u(low[0].z, low[1].z, low[2].z, low[3].z), vec4u(high[0].z, high[1].z, high[2].z, high[3].z),
        origin.z, shift.z, there);
    nodes[record] = origin.x | (origin.y << 16u);
    nodes[record + 1u] = origin.z | (shift.x << 16u) | (shift.y << 20u) | (shift.z << 24u);
    nodes[record + 2u] = x.x;
    nodes[record + 3u] = x.y;
    nodes[record + 4u] = y.x;
    nodes[record + 5u] = y.y;
    nodes[record + 6u] = z.x;
    nodes[record + 7u] = z.y;
}
