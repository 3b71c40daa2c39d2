// One invocation draws a virtual point light from all candidates, in proportion to their weights: light i of N is the
// candidate at (i + u) / N of all weight, so lights follow each other as candidates do, and every n-th of them is a
// stratified sample of all.
//
// While a lamp moves a little, all weights change a little, and with the sums that place moves on. Among texels it gets
// to a neighbour, but vertices of paths follow each other at random: there each half is drawn by a number of its own, so
// a light stays what it is unless one of them lies between what a share was and is. Those of lights that follow each
// other are additive recurrences, one for each level.
//
// flux = flux_j / (N p_j), p_j = weight_j / sum of weights; the area it stands for likewise. The lights' flux adds up to
// that of the candidates, exactly if they are weighed by flux alone.
#import "scene/sequence.wgsl"
#import "many_light/vpl/table.wgsl"
#import "common/random.wgsl"

@group(1) @binding(11) var<storage, read> cumulative: array<f32>;  // within blocks
@group(1) @binding(12) var<storage, read> totals: array<f32>;      // up to and with each block
@group(1) @binding(13) var<storage, read> rsm: array<vec4u>;
@group(1) @binding(14) var<storage, read> walk: array<vec4u>;
@group(1) @binding(15) var vpls: texture_storage_2d<rgba32uint, write>;
@group(1) @binding(19) var<uniform> params: Params;

struct Params {
    texels: u32,      // of reflective shadow maps
    candidates: u32,  // these and all vertices of paths
    count: u32,       // of lights to draw
    seed: u32,
}

const BLOCK: u32 = 256u;
// Blocks of vertices among which halves are drawn so. Chosen: with 8 or 128 lights stay as well.
const DRAWN_BLOCKS: u32 = 32u;
const GOLDEN_RATIO: u32 = 0x9e3779b9u;  // (sqrt(5) - 1) / 2, of 2^32

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let slot = id.x;
    if (slot >= params.count) {
        return;
    }
    let last = arrayLength(&totals) - 1u;
    let total = totals[last];
    let u = sobol_2d(sequence.index, params.seed).x;
    var wanted = min((f32(slot) + u) / f32(params.count), BELOW_ONE) * total;
    // Find the block, then the candidate.
    var code = hash2(sequence.index, params.seed);
    var stride = GOLDEN_RATIO;
    var low = 0u;
    var high = last;
    var before = 0.0;
    var upto = total;
    while (low < high) {
        let middle = (low + high) / 2u;
        code = hash(code);
        stride *= GOLDEN_RATIO;
        let by_halves = low * BLOCK >= params.texels && high - low < DRAWN_BLOCKS;
        wanted = select(wanted, before + unit_float(code + slot * stride) * (upto - before), by_halves);
        let is_left = totals[middle] > wanted;
        upto = select(upto, totals[middle], is_left);
        before = select(totals[middle], before, is_left);
        low = select(middle + 1u, low, is_left);
        high = select(high, middle, is_left);
    }
    let block = low;
    let by_halves = block * BLOCK >= params.texels;
    wanted -= before;
    low = block * BLOCK;
    high = min(low + BLOCK, params.candidates) - 1u;
    before = 0.0;
    upto = cumulative[high];
    while (low < high) {
        let middle = (low + high) / 2u;
        code = hash(code);
        stride *= GOLDEN_RATIO;
        wanted = select(wanted, before + unit_float(code + slot * stride) * (upto - before), by_halves);
        let is_left = cumulative[middle] > wanted;
        upto = select(upto, cumulative[middle], is_left);
        before = select(cumulative[middle], before, is_left);
        low = select(middle + 1u, low, is_left);
        high = select(high, middle, is_left);
    }
    let weight = cumulative[low] - select(0.0, cumulative[max(low, 1u) - 1u], low > block * BLOCK);
    var v: Vpl;
    if (low < params.texels) {
        v = unpack_vpl(rsm[2u * low], rsm[2u * low + 1u]);
    } else {
        let vertex = low - params.texels;
        v = unpack_vpl(walk[2u * vertex], walk[2u * vertex + 1u]);
    }
    // Rounding of the sums may have led to a candidate without weight: it stays black.
    let share = select(0.0, total / (f32(params.count) * weight), weight > 0.0 && total > 0.0);
    v.flux *= share;
    v.area *= share;
    textureStore(vpls, vpl_texel(2u * slot), pack_vpl_place(v));
    textureStore(vpls, vpl_texel(2u * slot + 1u), pack_vpl_light(v));
}
