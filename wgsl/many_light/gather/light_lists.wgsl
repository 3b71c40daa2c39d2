// One invocation finds which of 32 VPLs of a class can light each of four clusters (Olsson et al. 2012; Linke
// 2016, section 3.5).
//
// bit = [flux > 0 and a corner of the cluster's box has n . (corner - x) > 0]. In: VPLs, bounds of clusters, metres.
// Out: light lists, one mask per cluster, class and word. Conservative: a VPL is left out only where its light is
// exactly zero, so pictures do not change, bit for bit. Boxes of normals, which could cull VPLs behind all surfaces of
// a cluster, saved nothing in Sponza.
#import "many_light/gather/classes.wgsl"
#import "many_light/gather/clusters.wgsl"
#import "scene/info.wgsl"
#import "many_light/vpl/table.wgsl"

@group(1) @binding(11) var<storage, read_write> lists: array<u32>;
@group(1) @binding(12) var<storage, read> bounds: array<vec4f>;
@group(1) @binding(19) var<uniform> params: Params;

struct Params {
    vpl_count: u32,
}

const CLUSTERS: u32 = 4u;  // of a thread
// Widens boxes, over their coordinates: 168 times the unit roundoff of float32. Positions and dot products here and in
// the gathering pass take about 20 roundings.
const ROUNDING: f32 = 1e-5;

struct Box {
    centre: vec3f,
    half: vec3f,   // negative if the cluster is empty
}

// Returns the box of a cluster; beyond the last cluster, the last box (its masks are not stored again).
fn load_box(cluster: u32) -> Box {
    let first = min(2u * cluster, arrayLength(&bounds) - 2u);
    let low = bounds[first].xyz;
    let high = bounds[first + 1u].xyz;
    let half = (high - low) * 0.5 + (abs(low) + abs(high)) * ROUNDING;
    let is_empty = low.x > high.x;
    return Box(
        select((low + high) * 0.5, vec3f(0.0), is_empty), select(half, vec3f(-1.0), is_empty));
}

// Returns whether a corner of the box lies in front of the VPL.
fn can_light(vpl: Vpl, box: Box) -> bool {
    let half = box.half + abs(vpl.position) * ROUNDING;
    let before = dot(vpl.normal, box.centre - vpl.position) + dot(abs(vpl.normal), half);
    return (box.half.x >= 0.0) & (before > 0.0);
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let words = words_per_class(params.vpl_count) * class_count();
    let cluster = id.y * CLUSTERS;
    if (id.x >= words) {
        return;
    }
    // Test the VPLs of the word against the four boxes, unless all of them are empty.
    let class_number = id.x / words_per_class(params.vpl_count);
    let word = id.x % words_per_class(params.vpl_count);
    let a = load_box(cluster);
    let b = load_box(cluster + 1u);
    let c = load_box(cluster + 2u);
    let d = load_box(cluster + 3u);
    var found = vec4u(0u);
    var bits = slots_of_word(params.vpl_count, class_number, word);
    bits = select(0u, bits, max(max(a.half.x, b.half.x), max(c.half.x, d.half.x)) >= 0.0);
    while (bits != 0u) {
        let number = firstTrailingBit(bits);
        bits &= bits - 1u;
        let vpl = load_vpl(slot_of(class_number, 32u * word + number));
        let shines = max3(vpl.flux) > 0.0;
        let lit = vec4<bool>(can_light(vpl, a), can_light(vpl, b), can_light(vpl, c), can_light(vpl, d));
        found |= select(vec4u(0u), vec4u(1u << number), lit & vec4<bool>(shines));
    }
    // Store the masks, and once per tile its slicing.
    for (var k = 0u; k < CLUSTERS; k += 1u) {
        let tile = (cluster + k) / SLICES;
        if (cluster + k >= arrayLength(&bounds) / 2u) {
            continue;
        }
        lists[first_list(view.size) + (cluster + k) * words + id.x] = found[k];
        if (SLICES > 1u && id.x == 0u && (cluster + k) % SLICES == 0u) {
            lists[2u * tile] = bitcast<u32>(bounds[2u * (cluster + k)].w);
            lists[2u * tile + 1u] = bitcast<u32>(bounds[2u * (cluster + k) + 1u].w);
        }
    }
}
