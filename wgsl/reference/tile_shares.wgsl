// One workgroup for each half of the picture's rows divides the paths among the half's tiles.
//
// share = clamp(k sqrt(e), LEAST_SHARE, MOST_SHARE): e the error per pixel of the same tile in the other half, blurred
// over 3 x 3 tiles; k such that the mean share of the half's pixels is 1, which minimises the sum of e / share. If even
// the largest k leaves paths over, all tiles get them alike. In: sums by tile of `tile_errors.wgsl`. Out: the shares,
// and the mean radiance of the half.
#import "reference/learned.wgsl"

struct Tile {
    error: f32,
    radiance: f32,
    pixels: f32,
    unused: f32,
}

@group(1) @binding(0) var<storage, read> tiles: array<Tile>;

// A quarter keeps tiles in which the pilot paths missed the light from falling behind.
const LEAST_SHARE: f32 = 0.25;
const MOST_SHARE: f32 = 8.0;
const THREADS: u32 = 256u;
// Bisections of the logarithm of k between 2^-40 and 2^40.
const STEPS: u32 = 30u;

var<workgroup> sums: array<vec2f, THREADS>;

// Returns the sum of a value of all threads.
fn sum_of_all(local: u32, value: vec2f) -> vec2f {
    sums[local] = value;
    workgroupBarrier();
    for (var width = THREADS / 2u; width > 0u; width /= 2u) {
        if (local < width) {
            sums[local] += sums[local + width];
        }
        workgroupBarrier();
    }
    let sum = sums[0];
    workgroupBarrier();
    return sum;
}

// Returns the blurred root of the error per pixel around a tile; `first`: where its half begins.
fn blurred_deviation(tile: u32, size: vec2u, first: u32) -> f32 {
    let centre = vec2i(vec2u(tile % size.x, tile / size.x));
    var sum = vec2f(0.0);
    for (var i = 0; i < 9; i += 1) {
        let step = vec2i(i % 3, i / 3) - 1;
        let at = clamp(centre + step, vec2i(0), vec2i(size) - 1);
        let t = tiles[first + u32(at.y) * size.x + u32(at.x)];
        sum += vec2f(t.error, t.pixels) * f32((2 - abs(step.x)) * (2 - abs(step.y)));
    }
    return sqrt(sum.x / max(sum.y, 1.0));
}

fn scaled_share(word: u32, log_scale: f32) -> f32 {
    return clamp(exp2(log_scale) * learned_float(word), LEAST_SHARE, MOST_SHARE);
}

// Returns the sum over a half's pixels of their tiles' shares at a scale.
fn shared_paths(half: u32, local: u32, count: u32, log_scale: f32) -> f32 {
    var sum = 0.0;
    for (var tile = local; tile < count; tile += THREADS) {
        sum += scaled_share(share_word(half, tile), log_scale) * tiles[half * count + tile].pixels;
    }
    return sum_of_all(local, vec2f(sum, 0.0)).x;
}

@compute @workgroup_size(256)
fn main(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let half = workgroup.x;
    let size = (view.size + 7u) / 8u;
    let count = arrayLength(&tiles) / 2u;
    // The mean radiance; and the shares before their scale, which their places hold meanwhile.
    var radiance = vec2f(0.0);
    for (var tile = local; tile < count; tile += THREADS) {
        radiance += vec2f(tiles[half * count + tile].radiance, tiles[half * count + tile].pixels);
        learn_float(share_word(half, tile), blurred_deviation(tile, size, (1u - half) * count));
    }
    radiance = sum_of_all(local, radiance);
    let pixels = max(radiance.y, 1.0);
    if (local == 0u) {
        learn_float(MEANS + half, radiance.x / (3.0 * pixels));
    }
    // Find the scale, then divide what is left over.
    var low = -40.0;
    var high = 40.0;
    for (var step = 0u; step < STEPS; step += 1u) {
        let middle = 0.5 * (low + high);
        let too_many = shared_paths(half, local, count, middle) > pixels;
        low = select(middle, low, too_many);
        high = select(high, middle, too_many);
    }
    let rest = 1.0 - shared_paths(half, local, count, low) / pixels;
    for (var tile = local; tile < count; tile += THREADS) {
        let word = share_word(half, tile);
        learn_float(word, scaled_share(word, low) + rest);
    }
}
