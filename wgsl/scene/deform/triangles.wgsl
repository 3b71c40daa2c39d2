// One invocation writes the anchor and the edges of a deformed triangle, as `upload/anchors.py` does for others.
//
// In: posed vertices. Out: triangle records.
#import "scene/deform/mesh.wgsl"
#import "common/math.wgsl"

@group(1) @binding(2) var<storage, read_write> triangles: array<vec4u>;  // 4 each: anchor and material, edges, corners

const NONE: u32 = 0xffffffffu;  // its instance transforms it
// The layout of a triangle's flags: the anchor's weights, in steps of 2^-14, lie above 4 bits.
const FLAG_BITS: u32 = 4u;
const WEIGHT_BITS: u32 = 14u;
const STEPS: f32 = 16384.0;
const GAIN: f32 = 2.0;  // see `upload/anchors.py`

// Returns how far along an edge from `start` the point nearest to the origin lies, 0 to 1.
fn along(start: vec3f, edge: vec3f) -> f32 {
    return saturate(-dot(start, edge) / max(dot(edge, edge), SMALLEST_NORMAL));
}

// Returns the weights of the second and third corner at the point of a triangle that is nearest to the origin.
fn nearest_weights(first: vec3f, edge1: vec3f, edge2: vec3f) -> vec2f {
    // The nearest points of the three edges.
    let s = along(first, edge1);
    let t = along(first, edge2);
    let r = along(first + edge1, edge2 - edge1);
    var best = vec2f(s, 0.0);
    var least = length(first + s * edge1);
    for (var k = 0u; k < 2u; k += 1u) {
        let other = select(vec2f(1.0 - r, r), vec2f(0.0, t), k == 0u);
        let distance = length(first + other.x * edge1 + other.y * edge2);
        best = select(best, other, distance < least);
        least = min(least, distance);
    }
    // The nearest point of the plane, if it lies inside.
    let a = dot(edge1, edge1);
    let b = dot(edge1, edge2);
    let c = dot(edge2, edge2);
    let d = -dot(first, edge1);
    let e = -dot(first, edge2);
    let inside = vec2f(c * d - b * e, a * e - b * d) / max(a * c - b * b, SMALLEST_NORMAL);
    let is_inside = min(inside.x, inside.y) >= 0.0 && inside.x + inside.y <= 1.0;
    return select(best, inside, is_inside && length(first + inside.x * edge1 + inside.y * edge2) < least);
}

@compute @workgroup_size(256)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (id.x >= params.count) {
        return;
    }
    let record = 4u * (params.first + id.x);
    let corners = triangles[record + 3u];
    var anchor = posed_position(corners.x);
    let b = posed_position(corners.y);
    let c = posed_position(corners.z);
    let edge1 = b - anchor;
    let edge2 = c - anchor;
    var flags = triangles[record + 2u].w & ((1u << FLAG_BITS) - 1u);
    // Large triangles are stored relative to their point nearest to the origin, if that is much nearer.
    let extent = max(max(anchor, b), c) - min(min(anchor, b), c);
    if (max3(extent) > 0.5 * max3(abs(anchor))) {
        let weights = min(floor(nearest_weights(anchor, edge1, edge2) * STEPS), vec2f(STEPS - 1.0));
        let nearest = anchor + weights.x / STEPS * edge1 + weights.y / STEPS * edge2;
        if (length(nearest) * GAIN < length(anchor)) {
            anchor = nearest;
            flags |= (u32(weights.x) << FLAG_BITS) | (u32(weights.y) << (FLAG_BITS + WEIGHT_BITS));
        }
    }
    triangles[record] = vec4u(bitcast<vec3u>(anchor), triangles[record].w);
    triangles[record + 1u] = vec4u(bitcast<vec3u>(edge1), NONE);
    triangles[record + 2u] = vec4u(bitcast<vec3u>(edge2), flags);
}
