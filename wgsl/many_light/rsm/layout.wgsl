// The order of the texels of a reflective shadow map in the list of all texels: along a Hilbert curve, so that
// neighbours in the list are neighbours on the map. Resampled VPLs therefore move little if weights change little.

struct RsmLight {
    first: u32,   // texel of the list
    level: u32,   // log2 of the texels on a side
}

// Transforms a texel of a square into the curve's orientation in a quadrant; `last`: the square's last texel.
fn turn_quadrant(texel: vec2u, last: u32, quadrant: vec2u) -> vec2u {
    let mirrored = select(texel, last - texel, quadrant.x == 1u);
    return select(texel, mirrored.yx, quadrant.y == 0u);
}

// Returns the texel at a number along the curve.
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

// Returns the number of a texel along the curve: the inverse of `texel_of_number`.
fn number_of_texel(texel: vec2u, level: u32) -> u32 {
    var number = 0u;
    var inside = texel;  // the square of the level
    for (var k = level; k > 0u; k -= 1u) {
        let quadrant = (inside >> vec2u(k - 1u)) & vec2u(1u);
        number = 4u * number + ((3u * quadrant.x) ^ quadrant.y);
        inside = turn_quadrant(inside & vec2u((1u << (k - 1u)) - 1u), (1u << (k - 1u)) - 1u, quadrant);
    }
    return number;
}
