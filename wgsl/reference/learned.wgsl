// What adaptive runs of `path.wgsl` learn from the runs before, and how many paths each run traces.
//
// The first runs trace PILOT paths per pixel, the same everywhere. In these, each half of the picture, its even and its
// odd rows, learns from itself alone. They decide the tiles' shares of later paths: those of a half follow from the
// other half's pilot, so a pixel's number of paths does not depend on its own pilot (Kirk and Arvo 1991). Densities of a
// run follow from earlier runs. So means are unbiased.
#import "scene/info.wgsl"

override ADAPTIVE: bool = false;

// Paths per pixel with equal shares. Shares from 8 paths lose more by their noise than their early use gains (Sponza).
const PILOT: u32 = 16u;
// Runs up to PILOT paths: 4, 4 and 8, so that few paths have unguided light rays.
const PILOT_RUNS: u32 = 3u;
// Words: the number of the last run, the most paths that a pixel lacks after all runs, the mean radiance of each half.
const LAST_RUN: u32 = 0u;
const MISSING: u32 = 1u;
const MEANS: u32 = 2u;
// Then the guide (`guide.wgsl`), and last the share of each tile of each half.
const GUIDE_START: u32 = 16u;

@group(1) @binding(16) var<storage, read_write> learned: array<atomic<u32>>;

fn learned_float(word: u32) -> f32 {
    return bitcast<f32>(atomicLoad(&learned[word]));
}

fn learn_float(word: u32, value: f32) {
    atomicStore(&learned[word], bitcast<u32>(value));
}

fn half_of(pixel: vec2u) -> u32 {
    return pixel.y & 1u;
}

// Returns the word that holds the share of a tile of 8 x 8 pixels.
fn share_word(half: u32, tile: u32) -> u32 {
    let tiles = (view.size + 7u) / 8u;
    let count = tiles.x * tiles.y;
    return arrayLength(&learned) - 2u * count + half * count + tile;
}

// Returns the mean number of paths of all pixels after run `run`; each later run adds `samples`.
fn mean_paths(run: u32, samples: u32, spp: u32) -> u32 {
    let pilot = (PILOT >> 2u) << min(run, PILOT_RUNS - 1u);
    return min(pilot + (max(run, PILOT_RUNS - 1u) + 1u - PILOT_RUNS) * samples, spp);
}

// Returns the number of paths of a pixel after a run whose mean is `mean`.
fn paths_of(pixel: vec2u, mean: u32) -> u32 {
    if (mean <= PILOT) {
        return mean;
    }
    let tiles = (view.size.x + 7u) / 8u;
    let share = learned_float(share_word(half_of(pixel), pixel.y / 8u * tiles + pixel.x / 8u));
    return PILOT + u32(share * f32(mean - PILOT) + 0.5);
}
