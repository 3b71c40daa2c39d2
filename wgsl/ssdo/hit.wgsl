// What a direction meets: the pixel that shows the surface, the source that the pixel belongs to, where it lies from
// the surface that is lit and how much it counts. The layers of the camera's depth peeling are sources 0 to 3, further
// cameras 4 to 7.
#import "common/math.wgsl"

override LAYERS: u32 = 1u;   // of depth peeling, 1 to 4
override CAMERAS: u32 = 0u;  // further ones, 0 to 4

const NO_HIT: u32 = 0xffffffffu;
const FIRST_CAMERA: u32 = 4u;

// Sides of pictures are at most 2^13, so that a place has 26 bits.
fn pack_hit(pixel: vec2u, source: u32) -> u32 {
    return pixel.x | (pixel.y << 13u) | (source << 26u);
}

fn pixel_of_hit(hit: u32) -> vec2u {
    return vec2u(hit & 0x1fffu, (hit >> 13u) & 0x1fffu);
}

fn source_of_hit(hit: u32) -> u32 {
    return hit >> 26u;
}

// The way to a hit as the surface that is lit has it.
struct Way {
    direction: vec3f,  // unit
    share: f32,        // that the hit counts, 0 to 1
    steep: bool,       // it rises by more than FLAT
}

// Of two surfaces that bend by less than 3.4 degrees, neither sees the other: their form factor is below 0.1 %, and
// pixels cannot tell which directions meet. A sine.
const FLAT: f32 = 0.03;

// Directions are kept to 0.1 degrees, shares to 0.1 %.
fn pack_way(way: Way) -> u32 {
    let place = vec2u(round((octahedral_encode(way.direction) * 0.5 + 0.5) * 2047.0));
    let share = u32(round(saturate(way.share) * 511.0));
    return place.x | (place.y << 11u) | (share << 22u) | select(0u, 1u << 31u, way.steep);
}

fn unpack_way(code: u32) -> Way {
    let place = vec2f(vec2u(code, code >> 11u) & vec2u(2047u)) * (2.0 / 2047.0) - 1.0;
    return Way(octahedral_decode(place), f32((code >> 22u) & 511u) * (1.0 / 511.0), (code >> 31u) != 0u);
}
