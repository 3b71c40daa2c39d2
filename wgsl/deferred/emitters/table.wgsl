// The table of emitters: a binary tree of leaves, each a triangle that emits or a part of one
// (`upload/emitter_tree.py`, `upload/emitter_leaves.py`).
#import "scene/geometry.wgsl"

struct EmitterTable {
    width: u32,        // number of leaves, rounded up to a power of two
    radius: f32,       // of a leaf, metres: mean by power
    dimmest: f32,      // luminance of dim emitters over the sum of luminance times area, 1/m2
    triangles: u32,    // number of emitting triangles
    first_leaf: u32,   // texels at which parts of the table begin
    first_triangle: u32,
    first_place: u32,
}

// A node of the tree: bounds of the leaves below it. Nodes are in the order of a binary heap: node n has the children
// 2 n and 2 n + 1, the root is 1, and leaf k is node EmitterTable.width + k.
struct EmitterNode {
    centre: vec3f,   // of a sphere around the leaves, metres relative to the scene's origin
    radius: f32,
    axis: u32,       // of a cone around their normals, octahedral, snorm 16
    cosine: f32,     // of the cone's half angle
    power: f32,      // share of the sum of luminance times area; 0: nothing emits
}

// A leaf is a cell of the unit square, which `emitter_weights` maps to the triangle.
struct EmitterLeaf {
    corner: vec3f,   // of the whole triangle, metres relative to the scene's origin
    triangle: u32,
    edge1: vec3f,
    sides: u32,      // 1 emits from the side of edge1 x edge2, 2 from the other, 3 from both
    edge2: vec3f,
    area: f32,       // of the leaf, m2
    radiance: vec3f, // W/(m2 sr), before textures
    turn: u32,       // number of the triangle's corner that `corner` is
    cell: vec4f,     // low corner and size
}

// Texels in rows of TABLE_WIDTH: two for EmitterTable; two for each node; five for each leaf; one for each emitting
// triangle, sorted: triangle, instance, its first place, and its grid: bits of x, of y << 8, turn << 16; then four
// places in each texel: the number of a cell's leaf, NONE where the cell is dark, or HALVED | 2 k + axis where places k
// and k + 1 are the halves of the cell along x (0) or y (1).
const HALVED: u32 = 0x80000000u;
@group(1) @binding(20) var emitters: texture_storage_2d<rgba32uint, read>;

fn emitter_texel(index: u32) -> vec4u {
    return textureLoad(emitters, table_texel(index));
}

fn load_emitter_table() -> EmitterTable {
    let a = emitter_texel(0u);
    let b = emitter_texel(1u);
    return EmitterTable(a.x, bitcast<f32>(a.y), bitcast<f32>(a.z), a.w, b.x, b.y, b.z);
}

fn load_emitter_node(number: u32) -> EmitterNode {
    let a = bitcast<vec4f>(emitter_texel(2u * number + 2u));
    let b = emitter_texel(2u * number + 3u);
    return EmitterNode(a.xyz, a.w, b.x, bitcast<f32>(b.y), bitcast<f32>(b.z));
}

fn load_emitter_leaf(table: EmitterTable, number: u32) -> EmitterLeaf {
    let at = table.first_leaf + 5u * number;
    let a = emitter_texel(at);
    let b = emitter_texel(at + 1u);
    let c = bitcast<vec4f>(emitter_texel(at + 2u));
    let d = emitter_texel(at + 3u);
    return EmitterLeaf(
        bitcast<vec3f>(a.xyz), a.w, bitcast<vec3f>(b.xyz), b.w, c.xyz, c.w, bitcast<vec3f>(d.xyz), d.w,
        bitcast<vec4f>(emitter_texel(at + 4u)));
}

fn load_emitter_place(table: EmitterTable, number: u32) -> u32 {
    return emitter_texel(table.first_place + number / 4u)[number % 4u];
}

// Returns the leaf at a point of a triangle, or NONE.
fn find_emitter_leaf(table: EmitterTable, triangle: u32, instance: u32, barycentric: vec2f) -> u32 {
    // Find the triangle among those that emit (binary search).
    var low = 0u;
    var high = table.triangles;
    while (low < high) {
        let middle = (low + high) / 2u;
        let entry = emitter_texel(table.first_triangle + middle).xy;
        let is_before = entry.x < triangle || (entry.x == triangle && entry.y < instance);
        low = select(low, middle + 1u, is_before);
        high = select(middle, high, is_before);
    }
    if (low >= table.triangles) {
        return NONE;
    }
    let entry = emitter_texel(table.first_triangle + low);
    if (entry.x != triangle || entry.y != instance) {
        return NONE;
    }
    // Find the cell: invert `emitter_weights` for the turned triangle.
    let weights = vec3f(1.0 - barycentric.x - barycentric.y, barycentric);
    let turn = entry.w >> 16u;
    let across = weights[(turn + 1u) % 3u];
    let left = 1.0 - weights[(turn + 2u) % 3u];
    let u = vec2f(across / max(left, 1e-20), 1.0 - left * left);
    let bits = vec2u(entry.w, entry.w >> 8u) & vec2u(255u);
    let cells = vec2u(1u) << bits;
    let cell = vec2u(clamp(u * vec2f(cells), vec2f(0.0), vec2f(cells) - 0.5));
    var place = load_emitter_place(table, entry.z + cell.x + (cell.y << bits.x));
    if (HAS_EMISSION_MAPS) {
        // Go down to the part of the cell.
        var inside = u * vec2f(cells) - vec2f(cell);
        while (place != NONE && (place & HALVED) != 0u) {
            let along_y = (place & 1u) != 0u;
            let twice = 2.0 * select(inside.x, inside.y, along_y);
            let second = twice >= 1.0;
            let rest = select(twice, twice - 1.0, second);
            inside = select(vec2f(rest, inside.y), vec2f(inside.x, rest), along_y);
            place = load_emitter_place(table, ((place & ~HALVED) >> 1u) + select(0u, 1u, second));
        }
    }
    return place;
}
