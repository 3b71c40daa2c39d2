// Stores the light of a tile of the first level, and sums for the coarser levels: Phi_(k+1) = sum of Phi_k over four
// pixels.
//
// A workgroup of 16x16 threads takes 32x32 pixels of the first level, which are one pixel of the sixth, so one dispatch
// makes all levels. The importing shader calls `store_light` for the four pixels of each thread, then `store_coarser`.
// Out: codes of `common/light_code.wgsl`, W/sr: the rows of the first level, then those of each next level. Errs by the
// rounding of codes at each level, 0.001 % of the largest channel.
#import "common/light_code.wgsl"

override COARSER_LEVELS: u32 = 5u;  // at most 5

@group(1) @binding(12) var<storage, read_write> light: array<vec2u>;

const TILE_THREADS: u32 = 16u;  // along each side; four pixels each

var<workgroup> tile: array<vec2u, TILE_THREADS * TILE_THREADS>;

// Returns one of the four pixels of a thread, `k` from 0 to 3.
fn thread_pixel(thread: vec2u, k: u32) -> vec2u {
    return 2u * thread + vec2u(k & 1u, k >> 1u);
}

// Stores the light of a pixel of the first level; returns the decoded light.
fn store_light(pixel: vec2u, size: vec2u, value: vec3f) -> vec3f {
    let code = pack_light(value);
    light[pixel.y * size.x + pixel.x] = code;
    return unpack_light(code);
}

// Stores the light of the coarser levels. `first_size`: pixels of the first level; `sum`: light of the four pixels of
// the thread `local` of the workgroup `group`, 0 for those beyond the picture. All threads must call this.
fn store_coarser(group: vec2u, local: vec2u, first_size: vec2u, sum: vec3f) {
    var code = pack_light(sum);
    var offset = first_size.x * first_size.y;
    for (var level = 1u; level <= COARSER_LEVELS; level += 1u) {
        let side = (2u * TILE_THREADS) >> level;
        let is_in_tile = all(local < vec2u(side));
        if (level > 1u && is_in_tile) {
            var four = vec3f(0.0);
            for (var k = 0u; k < 4u; k += 1u) {
                let finer = thread_pixel(local, k);
                four += unpack_light(tile[finer.y * TILE_THREADS + finer.x]);
            }
            code = pack_light(four);
        }
        // Wait until all threads have read the finer level.
        workgroupBarrier();
        let size = (first_size + (1u << level) - 1u) >> vec2u(level);
        let pixel = group * side + local;
        if (is_in_tile) {
            tile[local.y * TILE_THREADS + local.x] = code;
            if (all(pixel < size)) {
                light[offset + pixel.y * size.x + pixel.x] = code;
            }
        }
        workgroupBarrier();
        offset += size.x * size.y;
    }
}
