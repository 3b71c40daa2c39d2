// One invocation draws a virtual point light from all candidates by importance resampling: VPL i of N is the candidate
// at (i + u) / N of the cumulative weight (systematic resampling), with
//
// flux = flux_j / (N p_j), area = area_j / (N p_j), p_j = w_j / sum of w.
//
// VPLs keep the order of candidates, so every n-th VPL is a stratified sample of all. In: candidates, W and m2, and
// their weights. Out: VPLs as `vpl.wgsl` packs them. Unbiased; their total flux is exact if weights are the flux.
//
// Temporal coherence: if a light moves a little, all weights and places (i + u) / N shift a little. A VPL at a texel
// then moves to a neighbour, since texels lie along a Hilbert curve. Vertices of light paths have no such order, so
// among them each level of the search draws its own random number: a VPL changes only if one of its numbers lies
// between the old and the new share of a half. On each level, the numbers of consecutive VPLs form an additive
// recurrence.
#import "scene/sequence.wgsl"
#import "many_light/vpl/candidates.wgsl"
#import "many_light/vpl/table.wgsl"
#import "common/random.wgsl"

@group(1) @binding(11) var<storage, read> cumulative: array<f32>;  // weights within blocks
@group(1) @binding(12) var<storage, read> totals: array<f32>;      // cumulative weights of blocks
@group(1) @binding(15) var vpls: texture_storage_2d<rgba32uint, write>;
@group(1) @binding(19) var<uniform> params: Params;

struct Params {
    texels: u32,      // of reflective shadow maps
    candidates: u32,  // texels and vertices of light paths
    count: u32,       // of VPLs
    seed: u32,
}

// The search draws a random number per level in ranges of vertices of at most this many blocks. Values from 8 to 128
// keep equally many VPLs in place while a lamp moves (tests/analytic/test_vpl.py).
const RANDOM_BLOCKS: u32 = 32u;
const GOLDEN_RATIO: u32 = 0x9e3779b9u;  // (sqrt(5) - 1) / 2, of 2^32

// A binary search for a place in cumulative weights, from `low` to `high`.
struct Search {
    low: u32,
    high: u32,
    before: f32,  // weight before the range
    upto: f32,    // weight up to the end of the range
    wanted: f32,  // the place
    code: u32,    // random state of the level
    stride: u32,  // of the additive recurrence of the level
}

// Returns the search at the next level; `random`: draw a new random place within the range.
fn next_level(search: Search, slot: u32, random: bool) -> Search {
    var s = search;
    s.code = hash(s.code);
    s.stride *= GOLDEN_RATIO;
    let drawn = s.before + unit_float(s.code + slot * s.stride) * (s.upto - s.before);
    s.wanted = select(s.wanted, drawn, random);
    return s;
}

// Returns the half of the range that holds the place, given the cumulative weight at its `middle`.
fn take_half(search: Search, middle: u32, weight: f32) -> Search {
    var s = search;
    let is_left = weight > s.wanted;
    s.upto = select(s.upto, weight, is_left);
    s.before = select(weight, s.before, is_left);
    s.low = select(middle + 1u, s.low, is_left);
    s.high = select(s.high, middle, is_left);
    return s;
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let slot = id.x;
    if (slot >= params.count) {
        return;
    }
    // Find the block.
    let last = arrayLength(&totals) - 1u;
    let total = totals[last];
    let u = sobol_2d(sequence.index, params.seed).x;
    let place = min((f32(slot) + u) / f32(params.count), BELOW_ONE) * total;
    var s = Search(0u, last, 0.0, total, place, hash2(sequence.index, params.seed), GOLDEN_RATIO);
    while (s.low < s.high) {
        let middle = (s.low + s.high) / 2u;
        s = next_level(s, slot, s.low * BLOCK >= params.texels && s.high - s.low < RANDOM_BLOCKS);
        s = take_half(s, middle, totals[middle]);
    }
    // Find the candidate in the block.
    let first = s.low * BLOCK;
    let are_vertices = first >= params.texels;
    s.wanted -= s.before;
    s.low = first;
    s.high = min(first + BLOCK, params.candidates) - 1u;
    s.before = 0.0;
    s.upto = cumulative[s.high];
    while (s.low < s.high) {
        let middle = (s.low + s.high) / 2u;
        s = next_level(s, slot, are_vertices);
        s = take_half(s, middle, cumulative[middle]);
    }
    // Divide by the candidate's probability. Rounding of the sums may select a candidate of weight 0, which makes a
    // black VPL.
    let weight = cumulative[s.low] - select(0.0, cumulative[max(s.low, 1u) - 1u], s.low > first);
    let candidate = load_candidate(s.low, params.texels);
    let share = select(0.0, total / (f32(params.count) * weight), weight > 0.0 && total > 0.0);
    let packed = pack_vpl(scale_vpl(candidate, share));
    let texel = vpl_words() * slot;
    textureStore(vpls, vpl_texel(texel), packed.place);
    textureStore(vpls, vpl_texel(texel + 1u), packed.light);
    if (HAS_LOBES) {
        textureStore(vpls, vpl_texel(texel + 2u), packed.arriving);
        textureStore(vpls, vpl_texel(texel + 3u), packed.lobe);
    }
}
