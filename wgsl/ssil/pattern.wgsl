// One invocation places one sample of a pattern: its offset from the receiver, and the area it represents.
//
// The first level samples the disc of radius r, the others the ring from r/2 to r (section 4). Departure: in the disc
// the radius, not its square, is uniform, so that near samples, which matter most, represent small areas. The 16
// patterns together form one Sobol sequence of groups. The groups of a pattern share the unit square among them, and
// the four candidates of a group its cell: each lies at the same place of its quarter. Out: offsets,
// pixels of the level, as two 16-bit floats; areas, pixels.
#import "scene/sequence.wgsl"
#import "ssil/interleaving.wgsl"
#import "common/math.wgsl"
#import "common/random.wgsl"

struct Params {
    radius: f32,  // r, pixels of a level
    seed: u32,
    groups: u32,  // of a pattern in each shape
}

@group(1) @binding(11) var<storage, read_write> pattern: array<vec2u>;
@group(1) @binding(19) var<uniform> params: Params;

// Returns the columns and rows of a grid of `count` cells, or of the power of two below it.
fn grid_of(count: u32) -> vec2f {
    let bits = firstLeadingBit(count);
    return vec2f(vec2u(1u) << vec2u((bits + 1u) / 2u, bits / 2u));
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let per_shape = PATTERNS * CANDIDATES * params.groups;
    if (id.x >= 2u * per_shape) {
        return;
    }
    let is_ring = id.x >= per_shape;
    let number = (id.x % per_shape) / CANDIDATES + sequence.index / PATTERNS * (per_shape / CANDIDATES);
    // Place the candidate in its part of the group's cell.
    let cells = grid_of(params.groups);
    let parts = grid_of(CANDIDATES);
    let in_cells = sobol_2d(number, params.seed ^ select(0u, RING_SEED, is_ring)) * cells;
    let candidate = f32(id.x % CANDIDATES);
    let part = vec2f(candidate % parts.x, floor(candidate / parts.x));
    let u = (floor(in_cells) + (part + fract(in_cells)) / parts) / cells;
    // Map the unit square to the disc or the ring.
    let r = params.radius;
    let radius = r * select(u.x, sqrt(0.25 + 0.75 * u.x), is_ring);
    let area = PI * r * select(2.0 * radius, 0.75 * r, is_ring) / f32(CANDIDATES * params.groups);
    let offset = radius * vec2f(cos(TWO_PI * u.y), sin(TWO_PI * u.y));
    pattern[id.x] = vec2u(pack2x16float(offset), bitcast<u32>(area));
}
