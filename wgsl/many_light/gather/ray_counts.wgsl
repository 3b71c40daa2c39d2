// One workgroup decides how many shadow rays each pixel of a tile gets in the next frame.
//
// K = sqrt(COST_RATIO v / b), from 1 to MOST_RAYS: v is the variance by visibility of a tile's pixel with one ray, over
// x^2 + 0.01 m^2 (relMSE), b the mean of the variance that rays do not lower. It minimises time times variance,
// (c0 + c sum K) (b + sum v / K). In: the tiles' records. Out: rays per pixel of each tile. b comes from the means of
// whole tiles over frames, so finer noise by other causes is missing: errs towards many rays there.
#import "many_light/gather/ray_record.wgsl"

@group(1) @binding(11) var<storage, read> tiles: array<RayTile>;
@group(1) @binding(12) var ray_counts: texture_storage_2d<r32uint, write>;
@group(1) @binding(19) var<uniform> params: Params;

struct Params {
    size: vec2u,  // tiles
}

const GROUP: u32 = 64u;
// Time of a frame without rays over that of one ray for all pixels, c0 / c, over the number of pixels whose visibility
// the blur averages. tools/README.md, "Constants".
const COST_RATIO: f32 = 0.1;
// Most rays per pixel where all tiles are alike. More gain in a corridor, but lose time in Sponza, where other noise is
// too fine to show in the means of tiles. tools/README.md, "Many-light".
const MOST_ALIKE: f32 = 5.0;
// Least variance that rays do not lower, over the variance by visibility with one ray.
const LEAST_OTHER: f32 = COST_RATIO / (MOST_ALIKE * MOST_ALIKE);

var<workgroup> sums: array<vec2f, GROUP>;

// Returns the sum over all threads of the workgroup.
fn sum_of_group(thread: u32, value: vec2f) -> vec2f {
    sums[thread] = value;
    for (var half = GROUP / 2u; half > 0u; half /= 2u) {
        workgroupBarrier();
        if (thread < half) {
            sums[thread] += sums[thread + half];
        }
    }
    workgroupBarrier();
    let found = sums[0];
    workgroupBarrier();
    return found;
}

@compute @workgroup_size(64)
fn main(@builtin(local_invocation_index) thread: u32) {
    // Find the picture's mean radiance.
    let count = arrayLength(&tiles);
    var sum = vec2f(0.0);
    for (var k = thread; k < count; k += GROUP) {
        sum += vec2f(tiles[k].radiance, 1.0) * tiles[k].pixels;
    }
    let all = sum_of_group(thread, sum);
    let mean = all.x / max(all.y, 1.0);
    // Find the mean relative variances, by visibility and by all else.
    let others = 1.0 / f32(max(sequence.still, 1u));
    var noise = vec2f(0.0);
    for (var k = thread; k < count; k += GROUP) {
        let tile = tiles[k];
        let weight = tile.pixels / max(tile.radiance * tile.radiance + 0.01 * mean * mean, 1e-37);
        noise += weight * vec2f(tile.one_ray, tile.squares * others - tile.rays);
    }
    let total = sum_of_group(thread, noise) / max(all.y, 1.0);
    let least = max(max(total.y, LEAST_OTHER * total.x), 1e-37);
    // Share out the rays.
    for (var k = thread; k < count; k += GROUP) {
        let tile = tiles[k];
        let variance = tile.one_ray / max(tile.radiance * tile.radiance + 0.01 * mean * mean, 1e-37);
        let rays = clamp(sqrt(COST_RATIO * variance / least) + 0.5, 1.0, f32(MOST_RAYS));
        textureStore(ray_counts, vec2u(k % params.size.x, k / params.size.x), vec4u(u32(rays)));
    }
}
