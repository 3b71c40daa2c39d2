// Triangles, instances and their two-level hierarchy; rays against them.
//
// Loads bound the traversal. So node boxes are 16-bit integers on a grid that spans the hierarchy (rounded outwards),
// 32 bytes for both children, and nodes, triangles and vertices lie in read-only storage textures, whose texels CPU
// drivers load in half of the time of a buffer's vec4 (llvmpipe, whole traversal: Cornell 217 -> 115 ns, Sponza 847
// -> 539). Meshes with one instance lie in the tree of the world itself; others are entered through their instance's
// transform.
#import "scene/info.wgsl"
#import "scene/materials.wgsl"

const NONE: u32 = 0xffffffffu;
// child references: an inner node's index, or one of these flags
const REF_LEAF: u32 = 0x80000000u;      // | (count - 1) << 28 | first triangle
const REF_INSTANCE: u32 = 0x40000000u;  // | instance
const STACK_SIZE: u32 = 64u;            // the builders bound the depth of both levels together by it
// triangle flags
const SMOOTH: u32 = 1u;       // has vertex normals
const COLORED: u32 = 2u;      // has vertex colours
const MASKED: u32 = 4u;       // its material has an alpha cutoff
const HAS_TANGENTS: u32 = 8u;

struct Node {
    low: vec3u,    // child 0 in the low half, child 1 in the high half
    child0: u32,
    high: vec3u,
    child1: u32,
}

struct Triangle {
    v0: vec3f,
    material: u32,
    edge1: vec3f,
    instance: u32,  // of a mesh that lies in the world's tree, else NONE
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

// Texels in rows of TABLE_WIDTH: 2 for a Node, 4 for a Triangle, 2 for a Vertex.
@group(1) @binding(3) var nodes: texture_storage_2d<rgba32uint, read>;
@group(1) @binding(4) var triangles: texture_storage_2d<rgba32uint, read>;
@group(1) @binding(5) var vertices: texture_storage_2d<rgba32uint, read>;
@group(1) @binding(7) var<storage, read> instances: array<Instance>;

const TABLE_WIDTH: u32 = 4096u;

fn table_texel(index: u32) -> vec2u {
    return vec2u(index % TABLE_WIDTH, index / TABLE_WIDTH);
}

fn load_node(index: u32) -> Node {
    let a = textureLoad(nodes, table_texel(2u * index));
    let b = textureLoad(nodes, table_texel(2u * index + 1u));
    return Node(a.xyz, a.w, b.xyz, b.w);
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

// Compiled out where the scene has none of it.
override HAS_INSTANCES: bool = true;
override HAS_MASKS: bool = true;
override HAS_VERTEX_COLORS: bool = true;

struct Hit {
    distance: f32,   // in lengths of the ray's direction
    triangle: u32,   // NONE: the ray left the scene
    instance: u32,
    barycentric: vec2f,
}

// Up to three rays that are traced together; a limit of 0 leaves one out.
struct Rays {
    shadow_a: Ray,
    limit_a: f32,    // in lengths of the ray's direction
    shadow_b: Ray,
    limit_b: f32,
    main: Ray,
    limit: f32,
}

struct Found {
    hit: Hit,           // the first of the main ray
    occluded_a: bool,   // something stands before a shadow ray's limit
    occluded_b: bool,
    steps: u32,         // nodes visited and triangles tested
}

// The ray in the grid of a hierarchy: a slab at integer q is reached after q * inverse + offset.
struct GridRay {
    inverse: vec3f,
    offset: vec3f,
}

// Three roundings of a slab's distance may put leaving before entering a flat box (Ize 2013, "Robust BVH Ray
// Traversal").
const SLACK: f32 = 1.0000004;

fn grid_ray(origin: vec3f, direction: vec3f, low: vec3f, scale: vec3f) -> GridRay {
    // A zero component would make 0 * inf = NaN; a tiny one reaches no slab but those it starts between.
    let scaled = direction * scale;
    let guarded = select(scaled, vec3f(1e-20), abs(scaled) < vec3f(1e-20));
    let inverse = 1.0 / guarded;
    return GridRay(inverse, (low - origin) * scale * inverse);
}

// Traces the rays one after the other in one loop, because lanes of a SIMD group that finish a ray go on to their next
// without waiting for each other.
fn trace_all(rays: Rays) -> Found {
    var found = Found(Hit(rays.limit, NONE, NONE, vec2f(0.0)), false, false, 0u);
    var stage = 0u;           // 1, 2: the shadow rays; 3: the main ray
    var world = rays.main;    // the ray being traced
    var origin = world.origin;
    var direction = world.direction;
    var nearest = 0.0;
    var grid = GridRay(vec3f(0.0), vec3f(0.0));
    var stack: array<u32, STACK_SIZE>;
    var top = 0u;
    var base = 0u;            // where the stack of the instance being visited begins
    var instance = NONE;
    var current = NONE;

    // The hit of a cut-out material whose alpha is still to be looked up.
    var masked = Hit(0.0, NONE, NONE, vec2f(0.0));

    // Look alpha up out here: inside, CPUs that run lanes in step would do so at each triangle, wanted or not (Sponza,
    // path tracer: 835 -> 555 ms).
    loop {
        masked.triangle = NONE;
        loop {
            if (current == NONE) {
                if (HAS_INSTANCES && instance != NONE && top > 0u) {
                    // Leave the instance and go on with what the world's tree still holds.
                    top -= 1u;
                    current = stack[top];
                } else {
                    // Start the next ray.
                    stage += 1u;
                    if (stage > 3u) {
                        break;
                    }
                    nearest = select(select(rays.limit_a, rays.limit_b, stage == 2u), rays.limit, stage == 3u);
                    if (nearest <= 0.0) {
                        continue;
                    }
                    world = rays.main;
                    if (stage == 1u) {
                        world = rays.shadow_a;
                    } else if (stage == 2u) {
                        world = rays.shadow_b;
                    }
                    current = scene.root;
                    top = 0u;
                }
                instance = NONE;
                base = 0u;
                origin = world.origin;
                direction = world.direction;
                grid = grid_ray(origin, direction, scene.frame_low, scene.frame_scale);
            }

            // Go down to the next leaf or instance, the nearer child first.
            while ((current & (REF_LEAF | REF_INSTANCE)) == 0u) {
                let node = load_node(current);
                found.steps += 1u;
                let a0 = vec3f(node.low & vec3u(0xffffu)) * grid.inverse + grid.offset;
                let a1 = vec3f(node.low >> vec3u(16u)) * grid.inverse + grid.offset;
                let b0 = vec3f(node.high & vec3u(0xffffu)) * grid.inverse + grid.offset;
                let b1 = vec3f(node.high >> vec3u(16u)) * grid.inverse + grid.offset;
                let enter0 = max(max3(min(a0, b0)), 0.0);
                let enter1 = max(max3(min(a1, b1)), 0.0);
                let leave0 = min(min3(max(a0, b0)) * SLACK, nearest);
                let leave1 = min(min3(max(a1, b1)) * SLACK, nearest);
                let meets0 = enter0 <= leave0;
                let meets1 = enter1 <= leave1;
                if (meets0 || meets1) {
                    let second = meets1 && (!meets0 || enter1 < enter0);
                    current = select(node.child0, node.child1, second);
                    if (meets0 && meets1) {
                        stack[top] = select(node.child1, node.child0, second);
                        top += 1u;
                    }
                } else if (top > base) {
                    top -= 1u;
                    current = stack[top];
                } else {
                    current = NONE;
                }
            }

            if (HAS_INSTANCES && current != NONE && (current & REF_LEAF) == 0u) {
                // Enter an instance: its own space, its own grid. Distances keep their meaning: the direction is not
                // normalised.
                instance = current & ~REF_INSTANCE;
                base = top;
                let local_from_world = instances[instance].local_from_world;
                origin = local_from_world * vec4f(world.origin, 1.0);
                direction = local_from_world * vec4f(world.direction, 0.0);
                grid = grid_ray(origin, direction, instances[instance].frame_low, instances[instance].frame_scale);
                current = instances[instance].root;
                continue;
            }

            if (current != NONE) {
                // Test the triangles of a leaf (Moeller and Trumbore 1997).
                var index = current & 0x0fffffffu;
                let end = index + ((current >> 28u) & 7u) + 1u;
                found.steps += end - index;
                var blocked = false;
                for (; index < end; index += 1u) {
                    let t = load_triangle(index);
                    let p = cross(direction, t.edge2);
                    let inverse = 1.0 / dot(t.edge1, p);
                    let s = origin - t.v0;
                    let q = cross(s, t.edge1);
                    let u = dot(s, p) * inverse;
                    let v = dot(direction, q) * inverse;
                    let distance = dot(t.edge2, q) * inverse;
                    // Written so that a NaN of an edge-on triangle fails.
                    if (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && distance > 0.0 && distance < nearest) {
                        if (HAS_MASKS && (t.flags & MASKED) != 0u) {
                            masked = Hit(
                                distance, index, select(instance, t.instance, t.instance != NONE), vec2f(u, v));
                            break;
                        }
                        nearest = distance;
                        if (stage < 3u) {
                            blocked = true;
                            break;
                        }
                        found.hit = Hit(distance, index, select(instance, t.instance, t.instance != NONE), vec2f(u, v));
                    }
                }
                if (blocked) {
                    // A shadow ray needs no more than that: drop what is left of it.
                    found.occluded_a = found.occluded_a || stage == 1u;
                    found.occluded_b = found.occluded_b || stage == 2u;
                    top = 0u;
                    base = 0u;
                    instance = NONE;
                }
                if (HAS_MASKS && masked.triangle != NONE && index + 1u < end) {
                    current = REF_LEAF | ((end - index - 2u) << 28u) | (index + 1u);
                } else if (top > base) {
                    top -= 1u;
                    current = stack[top];
                } else {
                    current = NONE;
                }
            }
            if (HAS_MASKS && masked.triangle != NONE) {
                break;
            }
        }

        if (!HAS_MASKS || masked.triangle == NONE) {
            break;
        }
        if (!is_cut_out(load_triangle(masked.triangle), masked.barycentric)) {
            nearest = masked.distance;
            if (stage < 3u) {
                found.occluded_a = found.occluded_a || stage == 1u;
                found.occluded_b = found.occluded_b || stage == 2u;
                top = 0u;
                base = 0u;
                instance = NONE;
                current = NONE;
            } else {
                found.hit = masked;
            }
        }
    }
    return found;
}

// Returns the first hit of a ray.
fn trace(ray: Ray, limit: f32) -> Hit {
    return trace_all(Rays(ray, 0.0, ray, 0.0, ray, limit)).hit;
}

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

// Returns the alpha of the base colour, given that of the vertex colours.
fn base_alpha(material: u32, vertex_alpha: f32, texcoord0: vec2f, texcoord1: vec2f) -> f32 {
    var alpha = materials[material].base_color.a * vertex_alpha;
    if (HAS_TEXTURES && has_texture(material, BASE_COLOR_SLOT)) {
        alpha *= sample_texture(material, BASE_COLOR_SLOT, texcoord0, texcoord1).a;
    }
    return alpha;
}

// Returns whether the base colour's alpha is below its material's cutoff at a point of a triangle.
fn is_cut_out(triangle: Triangle, barycentric: vec2f) -> bool {
    let k = load_corners(triangle, barycentric);
    return base_alpha(triangle.material, color_at(k).a, texcoord0_at(k), texcoord1_at(k))
        < materials[triangle.material].alpha_cutoff;
}
