// Drawing an emitter for a surface point: a walk down the tree that chooses each child by the light that it may send
// (Conty and Kulla 2018, "Importance Sampling of Many Lights with Adaptive Tree Splitting"; bounds as Pharr et al.
// 2023, "Physically Based Rendering", 4th ed., section 12.6.3).
#import "deferred/emitters/table.wgsl"

struct DrawnEmitter {
    leaf: u32,
    probability: f32,  // 0: no emitter can light the surface
    rest: f32,         // what the choices leave of the random number, in [0, 1)
}

// Returns cos(max(0, a - b)) of two angles in [0, pi], given as (cosine, sine).
fn cosine_of_difference(a: vec2f, b: vec2f) -> f32 {
    return select(a.x * b.x + a.y * b.y, 1.0, a.x > b.x);
}

fn with_sine(cosine: f32) -> vec2f {
    return vec2f(cosine, sqrt(max(1.0 - cosine * cosine, 0.0)));
}

// Returns an estimate of the irradiance that a node sends to a surface: power cos cos / d^2, with the largest cosines
// that the bounds allow. It is 0 only where the irradiance is.
fn node_importance(node: EmitterNode, position: vec3f, normal: vec3f) -> f32 {
    let way = node.centre - position;
    let squared = max(dot(way, way), 1e-37);
    let reach = node.radius * node.radius;
    let direction = way * inverseSqrt(squared);
    // The node's sphere spans an angle; from within, every direction.
    let sine = sqrt(min(reach / squared, 1.0));
    let spanned = vec2f(select(sqrt(max(1.0 - sine * sine, 0.0)), -1.0, squared <= reach), sine);
    let arriving = cosine_of_difference(with_sine(clamp(dot(normal, direction), -1.0, 1.0)), spanned);
    let axis = octahedral_decode(unpack2x16snorm(node.axis));
    let off_cone = cosine_of_difference(
        with_sine(clamp(-dot(axis, direction), -1.0, 1.0)), with_sine(node.cosine));
    let leaving = cosine_of_difference(with_sine(off_cone), spanned);
    return node.power * max(arriving, 0.0) * max(leaving, 0.0) / max(squared, reach);
}

// Draws a leaf for a surface point. `choice` in [0, 1).
fn draw_emitter(width: u32, position: vec3f, normal: vec3f, choice: f32) -> DrawnEmitter {
    var node = 1u;
    var drawn = DrawnEmitter(0u, 1.0, choice);
    while (node < width && drawn.probability > 0.0) {
        let a = node_importance(load_emitter_node(2u * node), position, normal);
        let b = node_importance(load_emitter_node(2u * node + 1u), position, normal);
        let share = a / max(a + b, 1e-37);
        let first = drawn.rest < share;
        let chance = select(1.0 - share, share, first);
        drawn.rest = min(select(drawn.rest - share, drawn.rest, first) / max(chance, 1e-37), BELOW_ONE);
        drawn.probability = select(0.0, drawn.probability * chance, a + b > 0.0);
        node = 2u * node + select(1u, 0u, first);
    }
    drawn.leaf = node - width;
    return drawn;
}

// Returns the probability that `draw_emitter` draws a leaf.
fn emitter_probability(width: u32, position: vec3f, normal: vec3f, leaf: u32) -> f32 {
    var node = width + leaf;
    var own = node_importance(load_emitter_node(node), position, normal);
    var probability = 1.0;
    while (node > 1u && probability > 0.0) {
        let first = (node & 1u) == 0u;
        let other = node_importance(load_emitter_node(node ^ 1u), position, normal);
        // As `draw_emitter` computes it, bit for bit.
        let share = select(other, own, first) / max(own + other, 1e-37);
        probability = select(0.0, probability * select(1.0 - share, share, first), own + other > 0.0);
        node /= 2u;
        own = node_importance(load_emitter_node(node), position, normal);
    }
    return probability;
}

// Returns a lower bound of the distance of the nearest emitter, metres.
fn emitter_gap(width: u32, position: vec3f) -> f32 {
    var least = FLOAT_MAX;
    let first = min(width, GAP_NODES);
    for (var k = 0u; k < first; k += 1u) {
        let node = load_emitter_node(first + k);
        let gap = max(length(node.centre - position) - node.radius, 0.0);
        least = min(least, select(FLOAT_MAX, gap, node.power > 0.0));
    }
    return least;
}

const GAP_NODES: u32 = 8u;  // of one level of the tree, a power of two
