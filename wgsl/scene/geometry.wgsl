// Triangles, instances and their two-level hierarchy; rays against them.
//
// Node boxes are 16-bit integers on a grid that spans the hierarchy (rounded outwards), because loads bound the
// traversal: 32 bytes hold both children. Meshes with one instance lie in the tree of the world itself; others are entered
// through their instance's transform.
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

@group(1) @binding(3) var<storage, read> nodes: array<Node>;
@group(1) @binding(4) var<storage, read> triangles: array<Triangle>;
@group(1) @binding(5) var<storage, read> indices: array<u32>;
@group(1) @binding(6) var<storage, read> vertices: array<Vertex>;
@group(1) @binding(7) var<storage, read> instances: array<Instance>;

// Compiled out where the scene has none of it.
override HAS_INSTANCES: bool = true;
override HAS_MASKS: bool = true;

struct Hit {
    distance: f32,   // in lengths of the ray's direction
    triangle: u32,   // NONE: the ray left the scene
    instance: u32,
    barycentric: vec2f,
}

struct PairHit {
    hit: Hit,
    occluded: bool,
}

// The ray in the grid of a hierarchy: a slab at integer q is reached after q * inverse + offset.
struct GridRay {
    inverse: vec3f,
    offset: vec3f,
}

fn grid_ray(origin: vec3f, direction: vec3f, low: vec3f, scale: vec3f) -> GridRay {
    // A zero component would make 0 * inf = NaN; a tiny one reaches no slab but those it starts between.
    let scaled = direction * scale;
    let guarded = select(scaled, vec3f(1e-20), abs(scaled) < vec3f(1e-20));
    let inverse = 1.0 / guarded;
    return GridRay(inverse, (low - origin) * scale * inverse);
}

// Finds whether `shadow` meets anything before `shadow_limit` (0: do not look), then the first hit of `ray` before
// `limit` (0: do not look). Both share one loop, because lanes of a SIMD group that finish the first go on to the second
// without waiting for each other.
fn trace_pair(shadow: Ray, shadow_limit: f32, ray: Ray, limit: f32) -> PairHit {
    var occluded = false;
    var hit = Hit(limit, NONE, NONE, vec2f(0.0));
    var finding_shadow = shadow_limit > 0.0;
    if (!finding_shadow && limit <= 0.0) {
        return PairHit(hit, occluded);
    }
    var origin = ray.origin;
    var direction = ray.direction;
    var nearest = limit;
    if (finding_shadow) {
        origin = shadow.origin;
        direction = shadow.direction;
        nearest = shadow_limit;
    }
    var grid = grid_ray(origin, direction, scene.frame_low, scene.frame_scale);
    var stack: array<u32, STACK_SIZE>;
    var top = 0u;
    var floor = 0u;           // where the stack of the instance being visited begins
    var instance = NONE;
    var current = scene.root;

    loop {
        // Go down to the next leaf or instance, the nearer child first.
        while ((current & (REF_LEAF | REF_INSTANCE)) == 0u) {
            let node = nodes[current];
            let a0 = vec3f(node.low & vec3u(0xffffu)) * grid.inverse + grid.offset;
            let a1 = vec3f(node.low >> vec3u(16u)) * grid.inverse + grid.offset;
            let b0 = vec3f(node.high & vec3u(0xffffu)) * grid.inverse + grid.offset;
            let b1 = vec3f(node.high >> vec3u(16u)) * grid.inverse + grid.offset;
            let enter0 = max(max3(min(a0, b0)), 0.0);
            let enter1 = max(max3(min(a1, b1)), 0.0);
            let leave0 = min(-max3(-max(a0, b0)), nearest);
            let leave1 = min(-max3(-max(a1, b1)), nearest);
            let meets0 = enter0 <= leave0;
            let meets1 = enter1 <= leave1;
            if (meets0 || meets1) {
                let second = meets1 && (!meets0 || enter1 < enter0);
                current = select(node.child0, node.child1, second);
                if (meets0 && meets1) {
                    stack[top] = select(node.child1, node.child0, second);
                    top += 1u;
                }
            } else if (top > floor) {
                top -= 1u;
                current = stack[top];
            } else {
                current = NONE;
            }
        }

        if (HAS_INSTANCES && current != NONE && (current & REF_LEAF) == 0u) {
            // Enter an instance: its own space, its own grid. Distances keep their meaning, the direction is not normalised.
            instance = current & ~REF_INSTANCE;
            floor = top;
            let world_origin = select(ray.origin, shadow.origin, finding_shadow);
            let world_direction = select(ray.direction, shadow.direction, finding_shadow);
            let local_from_world = instances[instance].local_from_world;
            origin = local_from_world * vec4f(world_origin, 1.0);
            direction = local_from_world * vec4f(world_direction, 0.0);
            grid = grid_ray(origin, direction, instances[instance].frame_low, instances[instance].frame_scale);
            current = instances[instance].root;
            continue;
        }

        if (current != NONE) {
            // Test the triangles of a leaf (Moeller and Trumbore 1997).
            var index = current & 0x0fffffffu;
            let end = index + ((current >> 28u) & 7u) + 1u;
            for (; index < end; index += 1u) {
                let edge1 = triangles[index].edge1;
                let edge2 = triangles[index].edge2;
                let p = cross(direction, edge2);
                let inverse = 1.0 / dot(edge1, p);
                let s = origin - triangles[index].v0;
                let q = cross(s, edge1);
                let u = dot(s, p) * inverse;
                let v = dot(direction, q) * inverse;
                let distance = dot(edge2, q) * inverse;
                // Written so that a NaN of an edge-on triangle fails.
                if (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && distance > 0.0 && distance < nearest) {
                    if (HAS_MASKS && (triangles[index].flags & MASKED) != 0u && is_cut_out(index, vec2f(u, v))) {
                        continue;
                    }
                    nearest = distance;
                    if (finding_shadow) {
                        occluded = true;
                        break;
                    }
                    hit = Hit(distance, index, instance, vec2f(u, v));
                }
            }
            if (top > floor && !occluded) {
                top -= 1u;
                current = stack[top];
            } else {
                current = NONE;
            }
        }

        if (HAS_INSTANCES && current == NONE && instance != NONE && !(finding_shadow && occluded)) {
            // Leave the instance and go on with what the world's tree still holds.
            instance = NONE;
            floor = 0u;
            origin = select(ray.origin, shadow.origin, finding_shadow);
            direction = select(ray.direction, shadow.direction, finding_shadow);
            grid = grid_ray(origin, direction, scene.frame_low, scene.frame_scale);
            if (top > 0u) {
                top -= 1u;
                current = stack[top];
            }
        }

        if (current == NONE) {
            if (!finding_shadow || limit <= 0.0) {
                break;
            }
            // The shadow ray is done: start the other one.
            finding_shadow = false;
            nearest = limit;
            origin = ray.origin;
            direction = ray.direction;
            grid = grid_ray(origin, direction, scene.frame_low, scene.frame_scale);
            top = 0u;
            floor = 0u;
            instance = NONE;
            current = scene.root;
        }
    }
    if (hit.triangle != NONE && hit.instance == NONE) {
        hit.instance = triangles[hit.triangle].instance;
    }
    return PairHit(hit, occluded);
}

// Returns the first hit of a ray.
fn trace(ray: Ray, limit: f32) -> Hit {
    return trace_pair(Ray(vec3f(0.0), vec3f(0.0)), 0.0, ray, limit).hit;
}

struct Corners {
    a: Vertex,
    b: Vertex,
    c: Vertex,
    weights: vec3f,
}

fn load_corners(triangle: u32, barycentric: vec2f) -> Corners {
    return Corners(
        vertices[indices[3u * triangle]], vertices[indices[3u * triangle + 1u]], vertices[indices[3u * triangle + 2u]],
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

// Returns whether the base colour's alpha is below its material's cutoff at a point of a triangle.
fn is_cut_out(triangle: u32, barycentric: vec2f) -> bool {
    let material = triangles[triangle].material;
    let corners = load_corners(triangle, barycentric);
    var alpha = materials[material].base_color.a * color_at(corners).a;
    if (HAS_TEXTURES && has_texture(material, BASE_COLOR_SLOT)) {
        alpha *= sample_texture(material, BASE_COLOR_SLOT, texcoord0_at(corners), texcoord1_at(corners)).a;
    }
    return alpha < materials[material].alpha_cutoff;
}
