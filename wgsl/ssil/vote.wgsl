// One invocation chooses the surfel of a pixel among its four finer pixels: the position and normal with the largest
// score survive; areas are summed. Nothing is averaged.
//
// s(i) = sum_j g1(|p_i - p_j|) g2(1 - n_i . n_j) g3(d_ij) over the pixels j at most one step from i (eq. 5). Departures:
// d_ij is the distance from the tangent plane of i in pixel widths, not a difference of depths, so that floors at a
// glancing angle are one surface. On flat walls all scores tie. Among samples a random pixel then wins, another one in
// each frame, so the mean of frames samples all pixels alike. Among receivers the pixel at the frame's corner of the
// square wins, so they form a regular grid. In: surfels. Out: surfels of the next level. Errs by omitting surfaces
// thinner than a pixel.
#import "ssil/surfel.wgsl"
#import "scene/sequence.wgsl"
#import "common/random.wgsl"
#import "ssil/corner.wgsl"

@group(1) @binding(11) var finer: texture_storage_2d<rgba32uint, read>;
@group(1) @binding(12) var surfels: texture_storage_2d<rgba32uint, write>;
@group(1) @binding(19) var<uniform> params: Params;

struct Params {
    seed: u32,       // of this level
    receivers: u32,  // 1: the pixel at the frame's corner wins a tie, 0: a random one
    coarser: u32,    // levels of receivers above this one
}

// Standard deviations of g1 (pixels), g2 (cosines) and g3 (pixel widths). tools/README.md, "Constants".
const STEP_WIDTH: f32 = 1.0;
const NORMAL_WIDTH: f32 = 0.1;
const PLANE_WIDTH: f32 = 1.0;
// Most that chance adds to a score: above the rounding of scores of at most 5, 3e-7, and far below the vote of a
// neighbour.
const TIE_BREAK: f32 = 1e-3;

// Returns the vote of a neighbour for a surfel, 0 to 1.
fn vote(position: vec3f, normal: vec3f, per_width: f32, other: vec4u) -> f32 {
    let turned = (1.0 - dot(normal, surfel_normal(other))) / NORMAL_WIDTH;
    let off = dot(normal, surfel_position(other) - position) * per_width / PLANE_WIDTH;
    let score = exp(-0.5 * (turned * turned + min(off * off, 1e4)));
    return select(score, 0.0, is_empty(other));
}

fn load(pixel: vec2i) -> vec4u {
    let size = vec2i(textureDimensions(finer));
    let texel = textureLoad(finer, vec2u(clamp(pixel, vec2i(0), size - 1)));
    return select(texel, vec4u(0u), any(pixel < vec2i(0)) || any(pixel >= size));
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (any(id.xy >= textureDimensions(surfels))) {
        return;
    }
    var best = vec4u(0u);
    var best_score = 0.0;
    var area = 0.0;
    let facing = facing_side();
    let near = exp(-0.5 / (STEP_WIDTH * STEP_WIDTH));
    let chance = hash2(id.x | (id.y << 16u), hash2(params.seed, sequence.index));
    let corner = corner_of(sequence.index, params.coarser);
    for (var k = 0; k < 4; k += 1) {
        let step = vec2u(vec2i(k & 1, k >> 1u));
        let pixel = 2 * vec2i(id.xy) + vec2i(step);
        let own = load(pixel);
        if (is_empty(own)) {
            continue;
        }
        area += surfel_area(own, facing);
        let position = surfel_position(own);
        let normal = surfel_normal(own);
        let width = f32(view.size.x) / f32(textureDimensions(finer).x);
        let per_width = inverseSqrt(max(facing_area(position, facing), 1e-37)) / width;
        let sides = vote(position, normal, per_width, load(pixel - vec2i(1, 0)))
            + vote(position, normal, per_width, load(pixel + vec2i(1, 0)))
            + vote(position, normal, per_width, load(pixel - vec2i(0, 1)))
            + vote(position, normal, per_width, load(pixel + vec2i(0, 1)));
        let preferred = select(unit_float(hash(chance + u32(k))), f32(all(step == corner)), params.receivers != 0u);
        let score = 1.0 + near * sides + TIE_BREAK * preferred;
        if (score > best_score) {
            best_score = score;
            best = own;
        }
    }
    if (best_score > 0.0) {
        best = pack_surfel(Surfel(surfel_position(best), surfel_normal(best), area), facing);
    }
    textureStore(surfels, id.xy, best);
}
