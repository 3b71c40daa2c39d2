// Ray traversal of the scene's two-level hierarchy, shared by all passes.
//
// Trees are binary. The traversal visits the nearer child first, with one stack for both levels (`geometry.wgsl`
// describes the tables). Boxes are padded for rounding, so the traversal misses no triangle that the ray-triangle test
// accepts.
#import "scene/corners.wgsl"
#import "scene/ray_triangle.wgsl"

const STACK_SIZE: u32 = 64u;  // entries; `upload/two_level_bvh.py` limits the summed depth of both levels to it

// Up to three rays, traced together; a limit of 0 skips a ray.
struct Rays {
    shadow_a: Ray,
    limit_a: f32,    // in lengths of the ray's direction
    shadow_b: Ray,
    limit_b: f32,
    main: Ray,
    limit: f32,
}

struct Found {
    hit: Hit,           // first hit of the main ray
    occluded_a: bool,   // the shadow ray hits something before its limit
    occluded_b: bool,
    steps: u32,         // nodes visited and triangles tested
}

// The ray in the grid of a hierarchy: it reaches the slab at integer q at the distance q * inverse + offset.
struct GridRay {
    inverse: vec3f,
    offset: vec3f,
}

// Three roundings of a slab's distance may put the exit of a flat box before its entry (Ize 2013, "Robust BVH Ray
// Traversal").
const SLACK: f32 = 1.0000004;

fn grid_ray(origin: vec3f, direction: vec3f, low: vec3f, scale: vec3f) -> GridRay {
    // A zero component would make 0 * inf = NaN; with 1e-20 the ray never leaves the slab that it starts in.
    let scaled = direction * scale;
    let guarded = select(scaled, vec3f(1e-20), abs(scaled) < vec3f(1e-20));
    let inverse = 1.0 / guarded;
    return GridRay(inverse, (low - origin) * scale * inverse);
}

// Traces up to three rays in one loop: a SIMD lane that finishes a ray starts its next one without waiting for other
// lanes.
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

    // The hit of an alpha-masked triangle, before its alpha lookup.
    var masked = Hit(0.0, NONE, NONE, vec2f(0.0));

    // Alpha is looked up outside the inner loop: inside, CPUs that run lanes in lockstep would look it up at every
    // triangle (Sponza, path tracer: 835 -> 555 ms).
    loop {
        masked.triangle = NONE;
        loop {
            if (current == NONE) {
                if (HAS_INSTANCES && instance != NONE && top > 0u) {
                    // Leave the instance: continue with the stack of the world's tree.
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
                // Enter an instance, with its own space and grid. The direction is not normalised, so distances stay
                // comparable.
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
                    let h = hit_plane(origin, direction, t);
                    if (is_in_triangle(h, t, nearest)) {
                        let met = Hit(
                            h.distance, index, select(instance, t.instance, t.instance != NONE), h.from_anchor);
                        if (HAS_MASKS && (t.flags & MASKED) != 0u) {
                            masked = met;
                            break;
                        }
                        nearest = h.distance;
                        if (stage < 3u) {
                            blocked = true;
                            break;
                        }
                        found.hit = met;
                    }
                }
                if (blocked) {
                    // Any hit ends a shadow ray: empty its stack.
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
        let t = load_triangle(masked.triangle);
        if (!is_cut_out(t, hit_weights(t, masked))) {
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

// Returns the first hit of a ray nearer than `limit`.
fn trace(ray: Ray, limit: f32) -> Hit {
    return trace_all(Rays(ray, 0.0, ray, 0.0, ray, limit)).hit;
}

// Returns in `occluded_a` whether a ray hits anything nearer than `limit`.
fn trace_shadow(ray: Ray, limit: f32) -> Found {
    return trace_all(Rays(ray, limit, ray, 0.0, ray, 0.0));
}
