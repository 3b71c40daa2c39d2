// Ray traversal of the scene's two-level hierarchy, shared by all passes.
//
// See-through surfaces (`see_through.wgsl`): shadow rays collect tints; a main ray passes each or finds it by chance.
// Tints and weights of glass are collected on the way to the hit, once it is known.
//
// Nodes have up to four children, visited nearest first, with one stack for both levels (`geometry.wgsl` describes the
// tables). Boxes are padded for rounding, so the traversal misses no triangle that the ray-triangle test accepts.
//
// A step visits a node and tests a triangle of the last leaf found, whose latencies overlap. CPU drivers that run eight
// rays in lockstep execute both in any case; loops that go down to the next leaf first take 1.3 to 1.5 times as long
// (llvmpipe, Sponza).
#import "scene/see_through.wgsl"
#import "scene/node.wgsl"
#import "scene/ray_triangle.wgsl"

const ABSENT: u32 = REF_LEAF;  // no reference: a leaf of no triangles
// Entries, one for each level of nodes, whose number `upload/wide_bvh.py` limits; the last is written, but never read.
const STACK_SIZE: u32 = 24u;

// Up to three rays, traced together; a limit of 0 skips a ray.
struct Rays {
    shadow_a: Ray,
    limit_a: f32,    // in lengths of the ray's direction
    shadow_b: Ray,
    limit_b: f32,
    main: Ray,
    limit: f32,
    seed: u32,       // of the main ray's choices at see-through surfaces; 0: they follow from the ray's own bits and `scene.seed`
    index: u32,      // of the sample in that seed's sequence
}

// Seeds without random choice: the ray passes what passes more than half of the light, or all see-through surfaces.
const MIDDLE_SEED: u32 = 0xffffffffu;
const PASSING_SEED: u32 = 0xfffffffeu;

struct Found {
    hit: Hit,           // first hit of the main ray
    occluded_a: bool,   // the shadow ray hits something before its limit
    occluded_b: bool,
    tint_a: vec3f,      // share of light that passes the see-through surfaces on the way of the shadow ray
    tint_b: vec3f,
    absorbed_a: vec3f,  // logarithm of a factor on tint_a, of solids that have been entered or left so far
    absorbed_b: vec3f,
    steps: u32,         // nodes visited and triangles tested
}

// Returns the number in [0, 1) by which a main ray passes a see-through triangle or not.
fn passing_number(rays: Rays, triangle: u32) -> f32 {
    if (rays.seed >= PASSING_SEED) {
        return select(0.5, -1.0, rays.seed == PASSING_SEED);
    }
    if (rays.seed != 0u) {
        return sobol_2d(rays.index, hash2(rays.seed, triangle)).x;
    }
    let d = bitcast<vec3u>(rays.main.direction);
    let o = bitcast<vec3u>(rays.main.origin);
    return unit_float(hash2(triangle, hash2(d.x ^ o.y, hash2(d.y ^ o.z, hash2(d.z ^ o.x, scene.seed)))));
}

// Traces up to three rays in one loop: a SIMD lane that finishes a ray starts its next one without waiting for other
// lanes. `any` and `closest` are constants: whether there are shadow rays, and a main ray.
fn traverse(rays: Rays, any: bool, closest: bool) -> Found {
    var found = Found(
        Hit(rays.limit, NONE, NONE, vec2f(0.0), UNTINTED), false, false, UNTINTED, UNTINTED, vec3f(0.0), vec3f(0.0), 0u);
    var stage = select(2u, 0u, any);  // 1, 2: the shadow rays; 3: the main ray; 4: its tint, on the way to its hit
    var last_stage = select(2u, 3u, closest);
    var nearest_glass = FLOAT_MAX;    // that the main ray has passed
    var world = rays.main;            // the ray being traced
    var origin = world.origin;
    var direction = world.direction;
    var nearest = 0.0;
    var grid = GridRay(vec3f(0.0), vec3f(0.0));
    var stack: array<u32, STACK_SIZE>;  // a node << 8 | its children still to visit, as `pack_rest`
    var top = 0u;
    var base = 0u;            // where the stack of the instance being visited begins
    var instance = NONE;
    var current = ABSENT;     // the reference to visit
    var first = 0u;           // the triangles still to be tested
    var end = 0u;
    var blocked = false;

    // The hit of an alpha-masked triangle, before its alpha lookup.
    var masked = Hit(0.0, NONE, NONE, vec2f(0.0), UNTINTED);

    // Alpha is looked up outside the inner loop: inside, CPUs that run lanes in lockstep would look it up at every
    // triangle (Sponza, path tracer: 835 -> 555 ms).
    loop {
        masked.triangle = NONE;
        loop {
            if (current == ABSENT && first >= end && top <= base) {
                if (HAS_INSTANCES && instance != NONE && top > 0u) {
                    // Leave the instance: continue with the next reference of the world's tree.
                    instance = NONE;
                    let entry = stack[top - 1u];
                    current = load_children(entry >> 8u)[entry & 3u];
                    let left = (entry & 255u) >> 2u;
                    stack[top - 1u] = (entry & ~255u) | left;
                    top -= select(0u, 1u, left == 1u);
                } else {
                    // Start the next ray.
                    stage += 1u;
                    if (HAS_TINTS && closest && stage == 4u && nearest_glass < found.hit.distance) {
                        last_stage = 4u;
                    }
                    if (stage > last_stage) {
                        break;
                    }
                    nearest = select(select(rays.limit_a, rays.limit_b, stage == 2u), rays.limit, stage == 3u);
                    if (HAS_TINTS && stage == 4u) {
                        nearest = found.hit.distance;
                    }
                    if (nearest <= 0.0) {
                        continue;
                    }
                    world = rays.main;
                    if (any && stage == 1u) {
                        world = rays.shadow_a;
                    } else if (any && stage == 2u) {
                        world = rays.shadow_b;
                    }
                    current = scene.root;
                    top = 0u;
                    instance = NONE;
                }
                base = 0u;
                origin = world.origin;
                direction = world.direction;
                grid = grid_ray(origin, direction, scene.frame_low, scene.frame_scale);
            }
            if (HAS_INSTANCES && (current & (REF_LEAF | REF_INSTANCE)) == REF_INSTANCE) {
                // Enter an instance, with its own space and grid. The direction is not normalised, so distances stay
                // comparable.
                instance = current & ~REF_INSTANCE;
                base = top;
                let local_from_world = instances[instance].local_from_world;
                origin = local_from_world * vec4f(world.origin, 1.0);
                direction = local_from_world * vec4f(world.direction, 0.0);
                grid = grid_ray(origin, direction, instances[instance].frame_low, instances[instance].frame_scale);
                current = instances[instance].root;
            }

            // Each step visits a node and tests a triangle.
            loop {
                // Both are loaded before either is used, so that their latencies overlap (llvmpipe: 1.1 times as fast).
                let tests = first < end;
                let t = load_triangle(select(0u, first, tests));
                let is_inner = (current & (REF_LEAF | REF_INSTANCE)) == 0u;
                let node = load_node(select(0u, current, is_inner));
                // The next reference on the stack.
                let has_next = top > base;
                let below = max(top, 1u) - 1u;
                let entry = stack[below];
                let next = load_children(entry >> 8u)[entry & 3u];

                var order = vec4u(NONE);
                let children = node.children;
                if (is_inner) {
                    order = meet_children(node, grid, nearest);
                    found.steps += 1u;
                }
                if (tests) {
                    // Moeller and Trumbore 1997.
                    let h = hit_plane(origin, direction, t);
                    if (is_in_triangle(h, t, nearest)) {
                        let met = Hit(
                            h.distance, first, select(instance, t.instance, t.instance != NONE), h.from_anchor, UNTINTED);
                        if (HAS_MASKS && (t.flags & MASKED) != 0u) {
                            masked = met;
                        } else if (any && (!closest || stage < 3u)) {
                            blocked = true;
                        } else {
                            nearest = h.distance;
                            found.hit = met;
                        }
                    }
                    first += 1u;
                    found.steps += 1u;
                }

                // The nearest child comes first; a leaf is tested from the next step on.
                let parent = current;
                var head = select(current, select(ABSENT, children[order.x & 3u], order.x != NONE), is_inner);
                let takes_leaf = (head & REF_LEAF) != 0u && first >= end;
                if (takes_leaf) {
                    first = head & 0x0fffffffu;
                    end = first + ((head >> 28u) & 7u);
                    order = vec4u(order.yzw, NONE);
                    head = select(ABSENT, children[order.x & 3u], order.x != NONE);
                }
                // Continue with it, or with the next reference on the stack.
                let pops = head == ABSENT && has_next;
                current = select(head, next, pops);
                // One write: what is left of the entry on top, or the node's other children.
                let rest = pack_rest(order);
                let left = (entry & 255u) >> 2u;
                stack[select(top, below, pops)] = select((parent << 8u) | rest, (entry & ~255u) | left, pops);
                top += select(0u, 1u, rest != 1u);
                top -= select(0u, 1u, pops && left == 1u);

                let waits = first >= end
                    && ((current == ABSENT && top <= base)
                        || (HAS_INSTANCES && (current & (REF_LEAF | REF_INSTANCE)) == REF_INSTANCE));
                if (blocked || (HAS_MASKS && masked.triangle != NONE) || waits) {
                    break;
                }
            }
            if (blocked) {
                // Any hit ends a shadow ray.
                found.occluded_a = found.occluded_a || stage == 1u;
                found.occluded_b = found.occluded_b || stage == 2u;
                blocked = false;
                current = ABSENT;
                end = first;
                top = 0u;
                base = 0u;
                instance = NONE;
            }
            if (HAS_MASKS && masked.triangle != NONE) {
                break;
            }
        }

        if (!HAS_MASKS || masked.triangle == NONE) {
            break;
        }
        let t = load_triangle(masked.triangle);
        let is_shadow = any && (!closest || stage < 3u);
        var stops = false;
        if (is_shadow && passes_shadow_rays(t.material)) {
            let tint = passage_of_hit(t, masked, world.direction, PASSES_GLASS).tint;
            let absorbed = absorbed_until(t, masked, world.direction);
            if (stage == 1u) {
                found.tint_a *= tint;
                found.absorbed_a += absorbed;
                stops = max3(found.tint_a) <= 0.0;
            } else {
                found.tint_b *= tint;
                found.absorbed_b += absorbed;
                stops = max3(found.tint_b) <= 0.0;
            }
        } else if (is_see_through(t.material)) {
            let p = passage_of_hit(t, masked, world.direction, false);
            if (HAS_TINTS && stage == 4u) {
                found.hit.tint *= p.passed;
            } else if (passing_number(rays, masked.triangle) < p.chance) {
                nearest_glass = min(nearest_glass, masked.distance);
            } else {
                masked.tint = vec3f(p.kept);
                stops = true;
            }
        } else if (!(HAS_TINTS && stage == 4u)) {
            stops = !is_cut_out(t, hit_weights(t, masked));
        }
        if (stops) {
            nearest = masked.distance;
            if (is_shadow) {
                found.occluded_a = found.occluded_a || stage == 1u;
                found.occluded_b = found.occluded_b || stage == 2u;
                current = ABSENT;
                end = first;
                top = 0u;
                base = 0u;
                instance = NONE;
            } else {
                found.hit = masked;
            }
        }
    }
    if (PASSES_GLASS && HAS_VOLUMES && any) {
        found.tint_a *= exp(min(found.absorbed_a, vec3f(0.0)));
        found.tint_b *= exp(min(found.absorbed_b, vec3f(0.0)));
    }
    return found;
}

// Traces up to three rays in one loop.
fn trace_all(rays: Rays) -> Found {
    return traverse(rays, true, true);
}

// Returns the first hit of a ray nearer than `limit`.
fn trace(ray: Ray, limit: f32) -> Hit {
    return traverse(Rays(ray, 0.0, ray, 0.0, ray, limit, 0u, 0u), false, true).hit;
}

// Returns the first hit of a ray that passes what passes more than half of the light: nothing is random.
fn trace_firm(ray: Ray, limit: f32) -> Hit {
    return traverse(Rays(ray, 0.0, ray, 0.0, ray, limit, MIDDLE_SEED, 0u), false, true).hit;
}

// Returns the factor on light that passes see-through surfaces nearer than `limit`, which a ray has passed by chance.
fn tint_of_passed(ray: Ray, limit: f32) -> vec3f {
    return traverse(Rays(ray, 0.0, ray, 0.0, ray, limit, PASSING_SEED, 0u), false, true).hit.tint;
}

// Returns in `occluded_a` whether a ray hits anything nearer than `limit`.
fn trace_shadow(ray: Ray, limit: f32) -> Found {
    return traverse(Rays(ray, limit, ray, 0.0, ray, 0.0, 0u, 0u), true, false);
}
