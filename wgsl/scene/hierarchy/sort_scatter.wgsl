// Each workgroup moves the pairs of its tile to their places by one digit; pairs of the same digit keep their order.
#import "scene/hierarchy/sort_tile.wgsl"

@group(1) @binding(3) var<storage, read_write> moved: array<vec2u>;

const WORDS: u32 = 8u;      // two digits' counters in a word
const RUNS: u32 = 32u;      // of threads whose counters one thread adds
const RUN: u32 = 8u;        // threads in a run

var<workgroup> counters: array<u32, 2048>;  // THREADS for each word: pairs of the threads before, by digit
var<workgroup> run_sums: array<u32, 256>;   // RUNS for each word

@compute @workgroup_size(THREADS)
fn main(@builtin(workgroup_id) tile: vec3u, @builtin(local_invocation_index) thread: u32) {
    // Count the digits of the thread's pairs.
    let count = arrayLength(&pairs);
    let first = (tile.x * THREADS + thread) * HELD;
    for (var w = 0u; w < WORDS; w += 1u) {
        counters[w * THREADS + thread] = 0u;
    }
    for (var k = 0u; k < HELD; k += 1u) {
        if (first + k < count) {
            let digit = digit_of(pairs[first + k].x);
            counters[(digit >> 1u) * THREADS + thread] += 1u << (16u * (digit & 1u));
        }
    }
    workgroupBarrier();
    // Make the counters of each run cumulative.
    let word = thread / RUNS;
    let start = word * THREADS + (thread % RUNS) * RUN;
    var sum = 0u;
    for (var k = 0u; k < RUN; k += 1u) {
        let own = counters[start + k];
        counters[start + k] = sum;
        sum += own;
    }
    run_sums[thread] = sum;
    workgroupBarrier();
    for (var step = 1u; step < RUNS; step <<= 1u) {
        var before = 0u;
        if (thread % RUNS >= step) {
            before = run_sums[thread - step];
        }
        workgroupBarrier();
        run_sums[thread] += before;
        workgroupBarrier();
    }
    // Move the pairs.
    let tiles = tile_count();
    for (var k = 0u; k < HELD; k += 1u) {
        if (first + k < count) {
            let pair = pairs[first + k];
            let digit = digit_of(pair.x);
            let at = (digit >> 1u) * THREADS + thread;
            let half = 16u * (digit & 1u);
            var rank = (counters[at] >> half) & 0xffffu;
            counters[at] += 1u << half;
            let run = thread / RUN;
            if (run > 0u) {
                rank += (run_sums[(digit >> 1u) * RUNS + run - 1u] >> half) & 0xffffu;
            }
            moved[counts[digit * tiles + tile.x] + rank] = pair;
        }
    }
}
