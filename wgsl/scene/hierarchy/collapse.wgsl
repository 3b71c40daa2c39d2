// Each invocation gives a wide node its children, up to four: those of the least cost (`merge.wgsl`).
//
// Departure: if one of them would take more levels than remain, those that take the fewest instead. In: the nodes of one
// round; rounds are taken from the last to the first, so that parents come before their children.
#import "scene/hierarchy/open.wgsl"

struct Range {
    first: u32,  // inner node
    count: u32,
}

@group(1) @binding(5) var<uniform> params: Range;
@group(1) @binding(6) var<storage, read> highs: array<vec4f>;
@group(1) @binding(7) var<storage, read> costs: array<vec2f>;
@group(1) @binding(8) var<storage, read_write> kids: array<vec4u>;  // nodes, NONE where there is none

struct Kids {
    node: vec4u,
    share: vec4u,  // as how many nodes each may be shown
    count: u32,
}

// Returns the costs of showing a node as one, two and three.
fn costs_of(node: u32) -> vec3f {
    let triangles = arrayLength(&pairs);
    if (node < triangles) {
        return vec3f(highs[node].w);
    }
    return vec3f(highs[node].w, costs[node - triangles]);
}

// Replaces a node by its two children.
fn open_kid(kids: Kids, k: u32, left_share: u32, right_share: u32) -> Kids {
    var opened = kids;
    let pair = children[kids.node[k] - arrayLength(&pairs)];
    for (var j = 3u; j > k; j -= 1u) {
        opened.node[j] = kids.node[j - 1u];
        opened.share[j] = kids.share[j - 1u];
    }
    opened.node[k] = pair.x;
    opened.node[k + 1u] = pair.y;
    opened.share[k] = left_share;
    opened.share[k + 1u] = right_share;
    opened.count += 1u;
    return opened;
}

// What a choice minimises: the cost, or the levels.
fn measure(node: u32, by_levels: bool) -> vec3f {
    if (by_levels) {
        return vec3f(levels_of(facts_of(node)));
    }
    return costs_of(node);
}

// Opens a node that may be shown as several, if that is better than one.
fn decide(kids: Kids, k: u32, by_levels: bool) -> Kids {
    var kept = kids;
    kept.share[k] = 1u;
    let node = kids.node[k];
    let value = measure(node, by_levels);
    let share = select(kids.share[k], 2u, kids.share[k] == 3u && value.y <= value.z);
    if (value.x <= select(value.y, value.z, share == 3u)) {
        return kept;
    }
    if (share == 2u) {
        return open_kid(kids, k, 1u, 1u);
    }
    let pair = children[node - arrayLength(&pairs)];
    let a = measure(pair.x, by_levels);
    let b = measure(pair.y, by_levels);
    let either = joined(vec2f(a.y, a.x), vec2f(b.x, b.y), by_levels);
    let left = select(1u, 2u, either.x < either.y);
    return open_kid(kids, k, left, 3u - left);
}

// Returns the sum of two values, or the larger number of levels.
fn joined(a: vec2f, b: vec2f, by_levels: bool) -> vec2f {
    return select(a + b, max(a, b), by_levels);
}

fn best_kids(pair: vec2u, by_levels: bool) -> Kids {
    // Share out four.
    let a = measure(pair.x, by_levels);
    let b = measure(pair.y, by_levels);
    let uneven = joined(a.xz, b.zx, by_levels);
    let even = joined(a.yy, b.yy, by_levels).x;
    let left = select(select(3u, 2u, even <= uneven.y), 1u, uneven.x <= min(even, uneven.y));
    var kids = Kids(vec4u(pair, NONE, NONE), vec4u(left, 4u - left, 1u, 1u), 2u);
    // Each is decided on until it remains one.
    for (var k = 0u; k < 4u; k += 1u) {
        for (var time = 0u; time < 3u; time += 1u) {
            if (k < kids.count && kids.share[k] > 1u) {
                kids = decide(kids, k, by_levels);
            }
        }
    }
    return kids;
}

fn most_levels(kids: Kids) -> u32 {
    var most = 0u;
    for (var k = 0u; k < kids.count; k += 1u) {
        most = max(most, levels_of(facts_of(kids.node[k])).x);
    }
    return most;
}

@compute @workgroup_size(256)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let inner = params.first + id.x;
    if (id.x >= params.count || wide[inner].levels == 0u) {
        return;
    }
    // Choose the children.
    let levels = wide[inner].levels - 1u;
    var found = best_kids(children[inner], false);
    if (most_levels(found) > levels) {
        found = best_kids(children[inner], true);
    }
    kids[inner] = found.node;
    // Give each its slots; an inner one becomes a wide node, too.
    var first = wide[inner].first;
    for (var k = 0u; k < found.count; k += 1u) {
        let facts = facts_of(found.node[k]);
        if ((facts & LEAF) != 0u) {
            list_triangles(found.node[k], first);
        } else {
            wide[found.node[k] - arrayLength(&pairs)] = Wide(levels, first);
        }
        first += triangles_of(facts);
    }
}
