// One workgroup measures the relative variance of the paths of a tile of 8 x 8 pixels, in each half of the rows.
//
// error = sum over pixels and channels of v / (t^2 + 0.01 m^2), as relMSE: v the variance of a path, t the mean of the
// pixel's row in the tile, m that of the half. In: means and squared deviations so far; the half's mean. Out: by half
// and tile, that sum, the sum of radiance, the number of pixels, of the pilot runs alone. Noisy: blurred by
// `tile_shares.wgsl`.
#import "reference/learned.wgsl"

struct Tile {
    error: f32,
    radiance: f32,  // sum over pixels and channels, W/(m2 sr)
    pixels: f32,
    unused: f32,
}

// Declared as written, because the pass that writes them comes later in a frame; only read here.
@group(1) @binding(0) var<storage, read_write> emission: array<vec4f>;   // a: number of paths
@group(1) @binding(1) var<storage, read_write> direct: array<vec4f>;
@group(1) @binding(2) var<storage, read_write> indirect: array<vec4f>;
@group(1) @binding(3) var<storage, read_write> deviation: array<vec4f>;
@group(1) @binding(4) var<storage, read_write> tiles: array<Tile>;

var<workgroup> means: array<vec4f, 64>;   // a: 1 for a pixel of the picture
var<workgroup> errors: array<f32, 64>;

@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let size = (view.size + 7u) / 8u;
    let tile = workgroup.x;
    let pixel = vec2u(tile % size.x, tile / size.x) * 8u + vec2u(local % 8u, local / 8u);
    let inside = all(pixel < view.size);
    let index = select(0u, pixel.y * view.size.x + pixel.x, inside);
    let n = emission[index].a;
    means[local] = select(
        vec4f(0.0), vec4f(emission[index].rgb + direct[index].rgb + indirect[index].rgb, 1.0), inside);
    workgroupBarrier();
    // The mean of a row is less noisy than a pixel's, which is small where its variance is underestimated.
    var row = vec4f(0.0);
    for (var i = 0u; i < 8u; i += 1u) {
        row += means[(local & ~7u) + i];
    }
    let t = row.rgb / max(row.a, 1.0);
    let m = learned_float(MEANS + half_of(pixel));
    let variance = deviation[index].rgb / max(n - 1.0, 1.0) * (scene.light_unit * scene.light_unit);
    let relative = variance / max(t * t + 0.01 * m * m, vec3f(1e-37));
    errors[local] = select(0.0, min(dot(relative, vec3f(1.0)), 1e30), inside);
    workgroupBarrier();
    // One thread sums each half.
    if (local < 2u && atomicLoad(&learned[LAST_RUN]) < PILOT_RUNS) {
        var sum = Tile(0.0, 0.0, 0.0, 0.0);
        for (var i = 0u; i < 32u; i += 1u) {
            let place = (2u * (i / 8u) + local) * 8u + i % 8u;
            sum.error += errors[place];
            sum.radiance += dot(means[place].rgb, vec3f(1.0));
            sum.pixels += means[place].a;
        }
        tiles[local * size.x * size.y + tile] = sum;
    }
}
