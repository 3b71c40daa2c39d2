// Where a light's reflective shadow map lies in the list of all texels: along a Hilbert curve, so that neighbours in the
// list are neighbours on the map. The curve has no leaps, so what is drawn along it moves a little as weights change a
// little.

struct RsmLight {
    first: u32,   // texel
    level: u32,   // log2 of texels a side
}

// Turns a square of the curve the way that its quadrant has it.
fn turn_quadrant(texel: vec2u, last: u32, quadrant: vec2u) -> vec2u {
    let mirrored = select(texel, last - texel, quadrant.x == 1u);
    return select(texel, mirrored.yx, quadrant.y == 0u);
}

// Returns the texel of a number along the curve.
fn texel_of_number(number: u32, level: u32) -> vec2u {
    var texel = vec2u(0u);
    for (var k = 0u; k < level; k += 1u) {
        let digit = number >> (2u * k);
        let right = (digit >> 1u) & 1u;
        let quadrant = vec2u(right, (digit ^ right) & 1u);
        texel = turn_quadrant(texel, (1u << k) - 1u, quadrant) + (quadrant << vec2u(k));
    }
    return texel;
}

// Returns the number along the curve of a texel of a map.
fn number_of_texel(texel: vec2u, level: u32) -> u32 {
    var number = 0u;
    var rest = texel;
    for (var k = level; k > 0u; k -= 1u) {
        let quadrant = (rest >> vec2u(k - 1u)) & vec2u(1u);
        number = 4u * number + ((3u * quadrant.x) ^ quadrant.y);
        rest = turn_quadrant(rest & vec2u((1u << (k - 1u)) - 1u), (1u << (k - 1u)) - 1u, quadrant);
    }
    return number;
}
