// The first hits of several rays of a VPL, one after the other in one loop.
//
// CPUs run all code of a loop for all lanes of a SIMD group, whether any of them needs it. So what is rare (cut-outs) or
// dear (directions) is kept out of the loop over nodes and triangles: a ray that meets what may be cut out leaves it.
#import "scene/geometry.wgsl"
#import "many_light/ism/map.wgsl"

// Metres along the VPL's normal that a ray starts above its surface, over the scene's radius: above the rounding of
// positions. Chosen.
const LEAVE: f32 = 1e-5;

@group(1) @binding(12) var<storage, read_write> hits: array<vec4u>;  // metres as bits, 0 for none; triangle; instance

// Rays from one point to places of a map in a row.
struct Fan {
    origin: vec3f,
    frame: mat3x3f,  // the map's, local to world
    texel: vec2f,    // of the map, where the first ray goes
    step: f32,       // along x to the next
    count: u32,
    first: u32,      // where their hits go
}

fn trace_fan(fan: Fan) {
    var ray = 0u;             // the next
    var direction = vec3f(0.0);
    var world_direction = vec3f(0.0);
    var origin = fan.origin;
    var hit = Hit(FLOAT_MAX, NONE, NONE, vec2f(0.0));
    var cut = Hit(0.0, NONE, NONE, vec2f(0.0));  // a hit of what may be cut out
    var grid = GridRay(vec3f(0.0), vec3f(0.0));
    var stack: array<u32, STACK_SIZE>;
    var top = 0u;
    var base = 0u;
    var instance = NONE;
    var current = NONE;
    loop {
        if (HAS_MASKS) {
            if (cut.triangle != NONE && !is_cut_out(load_triangle(cut.triangle), cut.barycentric)) {
                hit = cut;
            }
            cut.triangle = NONE;
        }
        if (current == NONE) {
            if (HAS_INSTANCES && instance != NONE && top > 0u) {
                top -= 1u;
                current = stack[top];
            } else {
                if (ray > 0u) {
                    hits[fan.first + ray - 1u] = vec4u(
                        bitcast<u32>(select(hit.distance, 0.0, hit.triangle == NONE)), hit.triangle, hit.instance, 0u);
                }
                if (ray >= fan.count) {
                    break;
                }
                world_direction = fan.frame * ray_direction(fan.texel + vec2f(fan.step * f32(ray), 0.0));
                ray += 1u;
                hit = Hit(FLOAT_MAX, NONE, NONE, vec2f(0.0));
                current = scene.root;
                top = 0u;
            }
            instance = NONE;
            base = 0u;
            origin = fan.origin;
            direction = world_direction;
            grid = grid_ray(origin, direction, scene.frame_low, scene.frame_scale);
        }
        loop {
            while ((current & (REF_LEAF | REF_INSTANCE)) == 0u) {
                let node = load_node(current);
                let a0 = vec3f(node.low & vec3u(0xffffu)) * grid.inverse + grid.offset;
                let a1 = vec3f(node.low >> vec3u(16u)) * grid.inverse + grid.offset;
                let b0 = vec3f(node.high & vec3u(0xffffu)) * grid.inverse + grid.offset;
                let b1 = vec3f(node.high >> vec3u(16u)) * grid.inverse + grid.offset;
                let enter0 = max(max3(min(a0, b0)), 0.0);
                let enter1 = max(max3(min(a1, b1)), 0.0);
                let leave0 = min(min3(max(a0, b0)) * SLACK, hit.distance);
                let leave1 = min(min3(max(a1, b1)) * SLACK, hit.distance);
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
            if (current == NONE || cut.triangle != NONE) {
                break;
            }
            if (HAS_INSTANCES && (current & REF_LEAF) == 0u) {
                instance = current & ~REF_INSTANCE;
                base = top;
                let local_from_world = instances[instance].local_from_world;
                origin = local_from_world * vec4f(fan.origin, 1.0);
                direction = local_from_world * vec4f(world_direction, 0.0);
                grid = grid_ray(origin, direction, instances[instance].frame_low, instances[instance].frame_scale);
                current = instances[instance].root;
                continue;
            }
            var index = current & 0x0fffffffu;
            let end = index + ((current >> 28u) & 7u) + 1u;
            for (; index < end; index += 1u) {
                let t = load_triangle(index);
                let p = cross(direction, t.edge2);
                let inverse = 1.0 / dot(t.edge1, p);
                let s = origin - t.v0;
                let q = cross(s, t.edge1);
                let u = dot(s, p) * inverse;
                let v = dot(direction, q) * inverse;
                let distance = dot(t.edge2, q) * inverse;
                if (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && distance > 0.0 && distance < hit.distance) {
                    let met = Hit(distance, index, select(instance, t.instance, t.instance != NONE), vec2f(u, v));
                    if (HAS_MASKS && (t.flags & MASKED) != 0u) {
                        cut = met;
                        break;
                    }
                    hit = met;
                }
            }
            if (HAS_MASKS && index + 1u < end) {
                current = REF_LEAF | ((end - index - 2u) << 28u) | (index + 1u);
            } else if (top > base) {
                top -= 1u;
                current = stack[top];
            } else {
                current = NONE;
            }
        }
    }
}
