// One workgroup turns the light that a run of `path.wgsl` found through a light's cells into densities of its rays.
//
// density = UNIFORM_SHARE + (1 - UNIFORM_SHARE) found / mean found; 1 everywhere if nothing was found. A thread does a
// row of cells. In: FOUND. Out: the other words of a grid of `guide.wgsl`; FOUND is 0 again. Unbiased: a light ray's
// flux is divided by its density.
#import "reference/guide.wgsl"

// Bounds the loss where the runs before found little: there, variance rises by at most the inverse.
const UNIFORM_SHARE: f32 = 0.2;

var<workgroup> row_sums: array<f32, SIDE>;

@compute @workgroup_size(32)
fn main(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) row: u32) {
    let grid = GUIDE_START + workgroup.x * GRID_WORDS;
    let cells = grid + row * SIDE;
    if (workgroup.x + row == 0u) {
        atomicStore(&learned[MISSING], 0u);
    }
    // Add what the last run found. The first run counts paths, so the second one starts over.
    let last_run = atomicLoad(&learned[LAST_RUN]);
    var sum = 0.0;
    for (var i = 0u; i < SIDE; i += 1u) {
        let found = f32(atomicExchange(&learned[cells + FOUND + i], 0u));
        let all_found = found + select(0.0, learned_float(cells + ALL_FOUND + i), last_run > 1u);
        learn_float(cells + ALL_FOUND + i, all_found);
        sum += all_found;
    }
    row_sums[row] = sum;
    workgroupBarrier();
    var total = 0.0;
    var up_to_row = 0.0;
    for (var i = 0u; i < SIDE; i += 1u) {
        total += row_sums[i];
        up_to_row += select(0.0, row_sums[i], i <= row);
    }
    // Tabulate densities and cumulative probabilities.
    let uniform_share = select(1.0, UNIFORM_SHARE, total > 0.0);
    let scale = (1.0 - uniform_share) * f32(CELLS) / max(total, 1e-37);
    let row_density = uniform_share + scale * sum / f32(SIDE);
    var up_to_cell = 0.0;
    for (var i = 0u; i < SIDE; i += 1u) {
        let density = uniform_share + scale * learned_float(cells + ALL_FOUND + i);
        up_to_cell += density / (row_density * f32(SIDE));
        learn_float(cells + DENSITY + i, density);
        learn_float(cells + UP_TO_CELL + i, up_to_cell);
    }
    learn_float(
        grid + UP_TO_ROW + row, uniform_share * f32(row + 1u) / f32(SIDE) + scale * up_to_row / f32(CELLS));
}
