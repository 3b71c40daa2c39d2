// Where the prefiltered maps of the environment lie in their texture: one below the other, octahedral.
//
// Map k holds the mean radiance under lobes of GGX alpha = 2^-k around each direction, in the picture's own frame.
// Map 0, alpha = 1, is the cosine's: irradiance over pi.
#import "common/math.wgsl"

const LAST_MAP: u32 = 6u;
// Texels a side: 64 for broad lobes; from k = 5, 4 * 2^k, which puts 1.4 texels or more across a lobe's half width.
const SMALL_SIDE: u32 = 64u;
const LAST_SIDE: u32 = 256u;
const LAST_ROW: u32 = 5u * SMALL_SIDE + LAST_SIDE / 2u;
const MAPS_HEIGHT: u32 = LAST_ROW + LAST_SIDE;

fn map_side(k: u32) -> u32 {
    return max(SMALL_SIDE, 4u << k);
}

fn map_row(k: u32) -> u32 {
    return select(SMALL_SIDE * k, LAST_ROW, k == LAST_MAP);
}

// Returns which map a row of the texture belongs to.
fn map_of_row(row: u32) -> u32 {
    return select(min(row / SMALL_SIDE, LAST_MAP - 1u), LAST_MAP, row >= LAST_ROW);
}

// Brings a texel next to a map's edge back into the map: the edges of an octahedral map are folded at their middles.
fn fold_texel(texel: vec2i, side: i32) -> vec2i {
    var t = texel;
    if (t.x < 0 || t.x >= side) {
        t = vec2i(clamp(t.x, 0, side - 1), side - 1 - t.y);
    }
    if (t.y < 0 || t.y >= side) {
        t = vec2i(side - 1 - t.x, clamp(t.y, 0, side - 1));
    }
    return t;
}
