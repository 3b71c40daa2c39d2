// The tables of a scene's geometry: the two-level hierarchy's nodes, triangles, vertices and instances.
//
// Meshes with one instance lie in the world's tree itself; rays enter the tree of any other mesh through an instance's
// transform. A node has up to four children. Their boxes are 8-bit integers in the node's frame, which lies on a grid of
// 16 bits that spans the tree, rounded outwards: coordinate = origin + (code << shift). Nodes, triangles and vertices
// are read-only storage textures: loads limit the traversal, and CPU drivers load a texel in half the time of a
// buffer's vec4 (llvmpipe, whole traversal: Cornell 217 -> 115 ns, Sponza 847 -> 539).
#import "scene/info.wgsl"
#import "scene/materials.wgsl"

const NONE: u32 = 0xffffffffu;
// child references: an inner node's index, or one of these flags
const REF_LEAF: u32 = 0x80000000u;      // | count << 28 | first triangle; an absent child is a leaf of 0 triangles
const REF_INSTANCE: u32 = 0x40000000u;  // | instance
// triangle flags; above them the weights of the anchor, 14 bits each
const SMOOTH: u32 = 1u;       // has vertex normals
const COLORED: u32 = 2u;      // has vertex colours
const MASKED: u32 = 4u;       // its material has an alpha cutoff, or is see-through
const HAS_TANGENTS: u32 = 8u;

struct Node {
    frame: vec2u,     // origin.x | origin.y << 16; origin.z | shift.x << 16 | shift.y << 20 | shift.z << 24
    x: vec2u,         // low and high codes, of child k in bits 8 k to 8 k + 7; an absent child's low is above its high
    y: vec2u,
    z: vec2u,
    children: vec4u,  // references
}

const ANCHOR_SHIFT: u32 = 4u;
const ANCHOR_BITS: u32 = 14u;

struct Triangle {
    anchor: vec3f,  // the point that hits are relative to: the first corner, or of large triangles that nearest to the
                    // origin (`upload/anchors.py`)
    material: u32,
    edge1: vec3f,
    instance: u32,  // of a mesh in the world's tree; NONE: the mesh has its own tree
    edge2: vec3f,
    flags: u32,
    corners: vec3u,  // entries of the table of vertices
}

struct Vertex {
    normal: u32,     // octahedral, snorm 16
    tangent: u32,    // octahedral, snorm 16; the lowest bit is set where the bitangent is flipped
    color: vec2u,    // unorm 16
    texcoord0: vec2f,
    texcoord1: vec2f,
}

struct Instance {
    world_from_local: mat4x3f,
    local_from_world: mat4x3f,
    frame_low: vec3f,
    root: u32,
    frame_scale: vec3f,
    pad: u32,
}

// Texels in rows of TABLE_WIDTH: 3 for a Node, 4 for a Triangle, 2 for a Vertex.
@group(1) @binding(3) var nodes: texture_storage_2d<rgba32uint, read>;
@group(1) @binding(4) var triangles: texture_storage_2d<rgba32uint, read>;
@group(1) @binding(5) var vertices: texture_storage_2d<rgba32uint, read>;
@group(1) @binding(7) var<storage, read> instances: array<Instance>;

const TABLE_WIDTH: u32 = 4096u;

fn table_texel(index: u32) -> vec2u {
    return vec2u(index % TABLE_WIDTH, index / TABLE_WIDTH);
}

fn load_node(index: u32) -> Node {
    let a = textureLoad(nodes, table_texel(3u * index));
    let b = textureLoad(nodes, table_texel(3u * index + 1u));
    return Node(a.xy, a.zw, b.xy, b.zw, load_children(index));
}

fn load_children(index: u32) -> vec4u {
    return textureLoad(nodes, table_texel(3u * index + 2u));
}

fn load_triangle(index: u32) -> Triangle {
    let a = textureLoad(triangles, table_texel(4u * index));
    let b = textureLoad(triangles, table_texel(4u * index + 1u));
    let c = textureLoad(triangles, table_texel(4u * index + 2u));
    let d = textureLoad(triangles, table_texel(4u * index + 3u));
    return Triangle(bitcast<vec3f>(a.xyz), a.w, bitcast<vec3f>(b.xyz), b.w, bitcast<vec3f>(c.xyz), c.w, d.xyz);
}

fn load_vertex(index: u32) -> Vertex {
    let a = textureLoad(vertices, table_texel(2u * index));
    let b = textureLoad(vertices, table_texel(2u * index + 1u));
    return Vertex(a.x, a.y, a.zw, bitcast<vec2f>(b.xy), bitcast<vec2f>(b.zw));
}

// Each is compiled out if the scene has none.
override HAS_INSTANCES: bool = true;
override HAS_MASKS: bool = true;
override HAS_VERTEX_COLORS: bool = true;

struct Hit {
    distance: f32,   // in lengths of the ray's direction
    triangle: u32,   // NONE: the ray left the scene
    instance: u32,
    from_anchor: vec2f,  // point - anchor = from_anchor.x edge1 + from_anchor.y edge2
    tint: vec3f,     // factor on light that comes along the ray: of see-through surfaces passed, and of that hit
}

const UNTINTED: vec3f = vec3f(1.0);  // nothing see-through lies on the way

// Returns the barycentric weights of the second and third corner at a triangle's anchor.
fn anchor_weights(t: Triangle) -> vec2f {
    let codes = vec2u(t.flags >> ANCHOR_SHIFT, t.flags >> (ANCHOR_SHIFT + ANCHOR_BITS)) & vec2u((1u << ANCHOR_BITS) - 1u);
    return vec2f(codes) * (1.0 / f32(1u << ANCHOR_BITS));
}

// Returns the barycentric weights of the second and third corner at a hit.
fn hit_weights(t: Triangle, hit: Hit) -> vec2f {
    return anchor_weights(t) + hit.from_anchor;
}

// Returns the point of a hit, in the space of the triangle.
fn hit_point(t: Triangle, hit: Hit) -> vec3f {
    return t.anchor + hit.from_anchor.x * t.edge1 + hit.from_anchor.y * t.edge2;
}

// Returns the first corner of a triangle.
fn first_corner(t: Triangle) -> vec3f {
    let weights = anchor_weights(t);
    return t.anchor - weights.x * t.edge1 - weights.y * t.edge2;
}
