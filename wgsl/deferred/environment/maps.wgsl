// Layout of the environment's prefiltered maps in their texture: octahedral, one below the other.
//
// Map k holds the mean radiance under lobes of GGX alpha = 2^-k around each direction, in the map's frame.
// Map 0 (alpha = 1) has the cosine lobe: irradiance over pi.
#import "common/math.wgsl"

const LAST_MAP: u32 = 6u;
// Texels a side: 64 for broad lobes; 4 * 2^k from k = 5 on, which puts 1.4 texels or more across a lobe's half width.
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

// Returns the texel inside the map that corresponds to one beyond its edge: octahedral edges fold at their middles.
fn fold_texel(texel: vec2i, side: i32) -> vec2i {
    let inside = clamp(texel, vec2i(0), vec2i(side - 1));
    let crosses = inside != texel;
    return vec2i(
        select(inside.x, side - 1 - inside.x, crosses.y), select(inside.y, side - 1 - inside.y, crosses.x));
}
