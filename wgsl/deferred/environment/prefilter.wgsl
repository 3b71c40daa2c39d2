// One invocation integrates 2 x 2 texels of the prefiltered maps: the mean radiance under a lobe around a direction d.
//
// sum L K dw / sum K dw with K(w) = D(h) max(w.d, 0), h half-way between w and d: the split sum with n = v = d (Karis
// 2013, "Real Shading in Unreal Engine 4"). Departure: the sum covers the whole map instead of samples, in quadtree
// cells that are small against the lobe and the distance from its middle. Even a small, bright sun causes no noise. In:
// cells. Out: maps, W/(m2 sr) before the scene's colour factor. Errs by the lobe's curvature within a cell, either way.
#import "common/ggx.wgsl"
#import "deferred/environment/cells.wgsl"
#import "deferred/environment/maps.wgsl"

@group(1) @binding(11) var<storage, read> cells: array<Cell>;
@group(1) @binding(12) var maps: texture_storage_2d<rgba32float, write>;

// Largest width of a cell over the scale on which the lobe changes, sqrt((2 alpha)^2 + angle^2). Against sums over all
// leaves, the maps of a sky with a sun are off by 0.5 % on average, 1.6 % at most; a value of 0.5 doubles the error and
// takes two thirds of the time.
const RELATIVE_WIDTH: f32 = 0.35;
// Largest width for alpha = 1, radians: of a cell, and of one that crosses the horizon of d, where K has a kink. Both
// grow by 1 / sqrt(alpha), since narrower lobes have less of their light far out. Irradiance is off by 0.4 % at most in
// the same comparison.
const LARGEST_WIDTH: f32 = 0.2;
const HORIZON_WIDTH: f32 = 0.1;

fn texel_direction(texel: vec2u, side: u32) -> vec3f {
    return octahedral_decode((vec2f(texel) + 0.5) / f32(side) * 2.0 - 1.0);
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let place = 2u * id.xy;
    let k = map_of_row(place.y);
    let side = map_side(k);
    if (place.x >= side || any(place >= textureDimensions(maps))) {
        return;
    }
    let texel = vec2u(place.x, place.y - map_row(k));
    let d = mat4x3f(
        texel_direction(texel, side), texel_direction(texel + vec2u(1u, 0u), side),
        texel_direction(texel + vec2u(0u, 1u), side), texel_direction(texel + vec2u(1u, 1u), side));
    let middle = normalize(d[0] + d[1] + d[2] + d[3]);
    let alpha = exp2(-f32(k));
    let a2 = alpha * alpha;

    // Traverse the tree depth first.
    var red = vec4f(0.0);
    var green = vec4f(0.0);
    var blue = vec4f(0.0);
    var weights = vec4f(0.0);
    var cell = TOP_CELLS;
    var level = TOP_LEVEL;
    var width = f32(1u << TOP_LEVEL) * (PI / f32(LEAVES_Y));  // of latitude, and of longitude or less, radians
    while (cell < 2u * TOP_CELLS || level < TOP_LEVEL) {
        let centre = cells[cell].centre.xyz;
        let cosine = dot(centre, middle);
        let meets_horizon = abs(cosine) < width;
        let limit = select(LARGEST_WIDTH, HORIZON_WIDTH, meets_horizon) * inverseSqrt(alpha);
        let scale = RELATIVE_WIDTH * sqrt(4.0 * a2 + 2.0 - 2.0 * cosine);
        let is_below = cosine < -1.5 * width;
        if (level > 0u && !is_below && width > min(limit, scale)) {
            level -= 1u;
            cell *= 4u;
            width *= 0.5;
        } else {
            if (!is_below) {
                let light = cells[cell].light;
                // As ggx_distribution, whose cos_h^2 is (1 + cosine) / 2.
                let cosines = max(centre * d, vec4f(0.0));
                let t = 0.5 - 0.5 * cosines + a2 * (0.5 + 0.5 * cosines);
                let weight = a2 * cosines / (t * t);
                red += weight * light.r;
                green += weight * light.g;
                blue += weight * light.b;
                weights += weight * light.a;
            }
            // Go to the next cell; after the last of four children, to the one after their parent.
            cell += 1u;
            let up = min(countTrailingZeros(cell) / 2u, TOP_LEVEL - level);
            cell >>= 2u * up;
            level += up;
            width *= f32(1u << up);
        }
    }
    let inverse = 1.0 / max(weights, vec4f(1e-30));
    red *= inverse;
    green *= inverse;
    blue *= inverse;
    for (var i = 0u; i < 4u; i += 1u) {
        textureStore(maps, place + vec2u(i % 2u, i / 2u), vec4f(red[i], green[i], blue[i], 1.0));
    }
}
