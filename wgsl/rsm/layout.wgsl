// Where a light's reflective shadow map lies in the list of all texels: along a Morton curve, so that neighbours in the
// list are neighbours on the map.

struct RsmLight {
    first: u32,   // texel
    level: u32,   // log2 of texels a side
}

// Returns the even bits of a Morton code, brought together.
fn even_bits(code: u32) -> u32 {
    var x = code & 0x55555555u;
    x = (x | (x >> 1u)) & 0x33333333u;
    x = (x | (x >> 2u)) & 0x0f0f0f0fu;
    x = (x | (x >> 4u)) & 0x00ff00ffu;
    return (x | (x >> 8u)) & 0x0000ffffu;
}

// Returns the Morton code of a texel of a map.
fn morton_code(texel: vec2u) -> u32 {
    var x = texel & vec2u(0xffffu);
    x = (x | (x << vec2u(8u))) & vec2u(0x00ff00ffu);
    x = (x | (x << vec2u(4u))) & vec2u(0x0f0f0f0fu);
    x = (x | (x << vec2u(2u))) & vec2u(0x33333333u);
    x = (x | (x << vec2u(1u))) & vec2u(0x55555555u);
    return x.x | (x.y << 1u);
}
