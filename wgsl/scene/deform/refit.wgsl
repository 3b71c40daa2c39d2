// One invocation refits a node: it boxes its children, and quantises the boxes as `upload/node_quantization.py` does.
//
// In: the nodes of one level, the last level first; posed vertices; the unions of the boxes of lower levels. Out: frames
// and codes of the nodes, and the union of each node's boxes. Boxes are rounded outwards: rays miss nothing.
#import "scene/deform/mesh.wgsl"

@group(1) @binding(2) var<storage, read> triangles: array<vec4u>;
@group(1) @binding(3) var<storage, read_write> nodes: array<vec4u>;  // 3 a node
@group(1) @binding(4) var<storage, read_write> unions: array<vec4f>;  // low and high corner by node, metres

const LEAF: u32 = 0x80000000u;
const LAST_STEP: f32 = 65280.0;  // of the grid that spans the tree, as in `upload/node_quantization.py`
const LAST_CODE: u32 = 255u;
// Grid steps added before rounding: those of `upload/node_quantization.py`, and as much again as float32 errs here, by
// 4 units of 65536 x 2^-24.
const PAD: f32 = 0.0625 + 0.03125;

struct Box {
    low: vec3f,
    high: vec3f,
}

// Returns the box of a child; an absent one's low corner is above its high one.
fn child_box(reference: u32) -> Box {
    if ((reference & LEAF) == 0u) {
        let child = 2u * (reference - params.first_node);
        return Box(unions[child].xyz, unions[child + 1u].xyz);
    }
    // A leaf's triangles.
    var box = Box(vec3f(3e38), vec3f(-3e38));
    let first = (reference & 0x0fffffffu) - params.first_triangle;
    let end = first + ((reference >> 28u) & 7u);
    for (var triangle = first; triangle < end; triangle += 1u) {
        let corners = triangles[4u * triangle + 3u];
        let a = posed_position(corners.x);
        let b = posed_position(corners.y);
        let c = posed_position(corners.z);
        box = Box(min(min(box.low, a), min(b, c)), max(max(box.high, a), max(b, c)));
    }
    return box;
}

// A box in steps of the grid, rounded outwards.
struct Steps {
    low: vec3u,
    high: vec3u,
}

fn steps_of(box: Box) -> Steps {
    let low = floor((box.low - params.grid_low) * params.grid_scale - PAD);
    let high = ceil((box.high - params.grid_low) * params.grid_scale + PAD);
    return Steps(vec3u(clamp(low, vec3f(0.0), vec3f(LAST_STEP))), vec3u(clamp(high, vec3f(0.0), vec3f(LAST_STEP))));
}

// Returns the least shift with which an extent in steps fits into 8 bits: codes of 255 after rounding up.
fn shift_of(extent: u32) -> u32 {
    // One below 2^k fits with a shift of k - 8; rounding up may take it to 256 there.
    let bits = 32u - countLeadingZeros(extent);
    let shift = select(0u, bits - 8u, bits > 8u);
    return shift + select(0u, 1u, (extent + (1u << shift) - 1u) >> shift > LAST_CODE);
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
    let children = nodes[3u * node + 2u];
    let exists = children != vec4u(LEAF);
    // Box the children; absent ones have the last step below and 0 above.
    let a = child_box(children.x);
    let b = child_box(children.y);
    let c = child_box(children.z);
    let d = child_box(children.w);
    unions[2u * node] = vec4f(min(min(a.low, b.low), min(c.low, d.low)), 0.0);
    unions[2u * node + 1u] = vec4f(max(max(a.high, b.high), max(c.high, d.high)), 0.0);
    let i = steps_of(a);
    let j = steps_of(b);
    let k = steps_of(c);
    let l = steps_of(d);
    // Write the frame, and the codes in it.
    let origin = min(min(i.low, j.low), min(k.low, l.low));
    let extent = max(max(i.high, j.high), max(k.high, l.high)) - origin;
    let shift = vec3u(shift_of(extent.x), shift_of(extent.y), shift_of(extent.z));
    let x = codes_of(vec4u(i.low.x, j.low.x, k.low.x, l.low.x), vec4u(i.high.x, j.high.x, k.high.x, l.high.x),
        origin.x, shift.x, exists);
    let y = codes_of(vec4u(i.low.y, j.low.y, k.low.y, l.low.y), vec4u(i.high.y, j.high.y, k.high.y, l.high.y),
        origin.y, shift.y, exists);
    let z = codes_of(vec4u(i.low.z, j.low.z, k.low.z, l.low.z), vec4u(i.high.z, j.high.z, k.high.z, l.high.z),
        origin.z, shift.z, exists);
    let frame = vec2u(origin.x | (origin.y << 16u), origin.z | (shift.x << 16u) | (shift.y << 20u) | (shift.z << 24u));
    nodes[3u * node] = vec4u(frame, x);
    nodes[3u * node + 1u] = vec4u(y, z);
}
