// One invocation poses a vertex of a deformed instance: linear blend skinning of the morphed vertex.
//
// p' = sum_i w_i M_i (p + sum_t m_t d_t); normals and tangents by the linear part, normalised (glTF 2.0, 3.7.3.3).
// In: the bind pose, joint matrices, morph weights. Out: positions in metres, local; codes of normals and tangents.
// Rounds in float32, about 1e-6 of the mesh's extent.
#import "common/math.wgsl"

struct Params {
    count: u32,         // vertices
    first_vertex: u32,  // among all that are posed
    first_matrix: u32,
    first_weight: u32,
}

// Each is compiled out if the mesh has none.
override NORMALS: bool = true;
override TANGENTS: bool = true;
override MORPHS: bool = true;

struct RestVertex {
    position: vec3f,       // metres from the centre of the mesh; the matrices expect that
    first_influence: u32,  // up to that of the next vertex
    normal: vec3f,         // zero: none
    first_morph: u32,      // up to that of the next vertex
    tangent: vec3f,        // zero: none
    flipped: u32,          // 1: the bitangent is
}

struct Influence {
    joint: u32,
    weight: f32,
}

// A displacement of a vertex by a morph target.
struct Morph {
    position: vec3f,
    number: u32,  // of the target
    normal: vec3f,
    tangent: vec3f,
}

@group(1) @binding(0) var<uniform> params: Params;
@group(1) @binding(1) var<storage, read> rest: array<RestVertex>;
@group(1) @binding(2) var<storage, read> influences: array<Influence>;
@group(1) @binding(3) var<storage, read> morphs: array<Morph>;
@group(1) @binding(4) var<storage, read> matrices: array<vec4f>;  // 3 rows a joint
@group(1) @binding(5) var<storage, read> morph_weights: array<f32>;
@group(1) @binding(6) var<storage, read_write> posed: array<vec4f>;
@group(1) @binding(7) var<storage, read_write> vertices: array<vec4u>;  // 2 a vertex, as Vertex of `scene/geometry.wgsl`

// Returns the code of a direction of any length, as `upload/mesh_data.py`; the zero vector encodes +Z.
fn direction_code(v: vec3f) -> u32 {
    return pack2x16snorm(octahedral_encode(normalize_or(v, vec3f(0.0, 0.0, 1.0))));
}

@compute @workgroup_size(256)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let index = id.x;
    if (index >= params.count) {
        return;
    }
    var position = rest[index].position;
    var normal = vec3f(0.0);
    var tangent = vec3f(0.0);
    if (NORMALS) {
        normal = rest[index].normal;
    }
    if (TANGENTS) {
        tangent = rest[index].tangent;
    }
    // A vertex without normal or tangent does not get one.
    let is_smooth = any(normal != vec3f(0.0));
    let has_tangent = any(tangent != vec3f(0.0));
    // Displace it; targets without weight are not read.
    if (MORPHS) {
        let morphs_end = rest[index + 1u].first_morph;
        for (var m = rest[index].first_morph; m < morphs_end; m += 1u) {
            let weight = morph_weights[params.first_weight + morphs[m].number];
            if (weight != 0.0) {
                position += weight * morphs[m].position;
                normal += weight * morphs[m].normal;
                tangent += weight * morphs[m].tangent;
            }
        }
    }
    // Blend the matrices of its joints.
    var x = vec4f(0.0);
    var y = vec4f(0.0);
    var z = vec4f(0.0);
    let influences_end = rest[index + 1u].first_influence;
    for (var i = rest[index].first_influence; i < influences_end; i += 1u) {
        let weight = influences[i].weight;
        let row = params.first_matrix + 3u * influences[i].joint;
        x += weight * matrices[row];
        y += weight * matrices[row + 1u];
        z += weight * matrices[row + 2u];
    }
    // Write the result.
    let out = params.first_vertex + index;
    let point = vec4f(position, 1.0);
    posed[out] = vec4f(dot(x, point), dot(y, point), dot(z, point), 0.0);
    if (is_smooth) {
        vertices[2u * out].x = direction_code(vec3f(dot(x.xyz, normal), dot(y.xyz, normal), dot(z.xyz, normal)));
    }
    if (has_tangent) {
        let code = direction_code(vec3f(dot(x.xyz, tangent), dot(y.xyz, tangent), dot(z.xyz, tangent)));
        vertices[2u * out].y = (code & 0xfffffffeu) | rest[index].flipped;
    }
}
