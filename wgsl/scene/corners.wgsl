// Vertex attributes at a point of a triangle, and the alpha test there.
#import "scene/geometry.wgsl"

struct Corners {
    a: Vertex,
    b: Vertex,
    c: Vertex,
    weights: vec3f,
}

fn load_corners(triangle: Triangle, barycentric: vec2f) -> Corners {
    return Corners(
        load_vertex(triangle.corners.x), load_vertex(triangle.corners.y), load_vertex(triangle.corners.z),
        vec3f(1.0 - barycentric.x - barycentric.y, barycentric));
}

fn texcoord0_at(k: Corners) -> vec2f {
    return k.weights.x * k.a.texcoord0 + k.weights.y * k.b.texcoord0 + k.weights.z * k.c.texcoord0;
}

fn texcoord1_at(k: Corners) -> vec2f {
    return k.weights.x * k.a.texcoord1 + k.weights.y * k.b.texcoord1 + k.weights.z * k.c.texcoord1;
}

fn unpack_color(c: vec2u) -> vec4f {
    return vec4f(unpack2x16unorm(c.x), unpack2x16unorm(c.y));
}

fn color_at(k: Corners) -> vec4f {
    return k.weights.x * unpack_color(k.a.color) + k.weights.y * unpack_color(k.b.color)
        + k.weights.z * unpack_color(k.c.color);
}

// Returns the base colour's alpha over a footprint, or at a point; `vertex_alpha` is that of the vertex colours.
fn base_alpha(
    material: u32, vertex_alpha: f32, uv0: vec2f, uv1: vec2f, footprint: UvFootprint, is_point: bool
) -> f32 {
    var alpha = materials[material].base_color.a * vertex_alpha;
    if (HAS_TEXTURES && has_texture(material, BASE_COLOR_SLOT)) {
        alpha *= read_texture(material, BASE_COLOR_SLOT, uv0, uv1, footprint, is_point).a;
    }
    return alpha;
}

// Returns whether the base colour's alpha is below its material's cutoff at a point of a triangle.
fn is_cut_out(triangle: Triangle, barycentric: vec2f) -> bool {
    let k = load_corners(triangle, barycentric);
    let alpha = base_alpha(
        triangle.material, color_at(k).a, texcoord0_at(k), texcoord1_at(k), UvFootprint(vec4f(0.0), vec4f(0.0), 1.0),
        true);
    return alpha < materials[triangle.material].alpha_cutoff;
}
