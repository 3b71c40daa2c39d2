// One invocation finds one texel of the prefiltered maps: the mean radiance under a lobe around a direction d.
//
// sum L K dw / sum K dw with K(w) = D(h) max(w.d, 0), h half-way between w and d: the split sum with n = v = d (Karis
// 2013, "Real Shading in Unreal Engine 4"). Departure: all of the picture is summed, as cells of the quadtree that are
// small against the lobe and the distance from its middle, instead of samples: no noise, however small and bright a
// sun is.
// In: cells. Out: maps, W/(m2 sr) before the scene's colour factor. Errs by the lobe's curvature within a cell.
#import "common/brdf.wgsl"
#import "environment/cells.wgsl"
#import "environment/maps.wgsl"

@group(1) @binding(11) var<storage, read> cells: array<Cell>;
@group(1) @binding(12) var maps: texture_storage_2d<rgba32float, write>;

// Largest width of a cell over the scale on which the lobe changes, sqrt((2 alpha)^2 + angle^2).
const RELATIVE_WIDTH: f32 = 0.5;
// Largest width, radians: 32 x 16 cells, and 64 x 32 where the horizon of d passes, at which K has a kink.
const LARGEST_WIDTH: f32 = 0.2;
const HORIZON_WIDTH: f32 = 0.1;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let k = map_of_row(id.y);
    let side = map_side(k);
    if (id.x >= side || any(id.xy >= textureDimensions(maps))) {
        return;
    }
    let texel = vec2u(id.x, id.y - map_row(k));
    let d = octahedral_decode((vec2f(texel) + 0.5) / f32(side) * 2.0 - 1.0);
    let alpha = exp2(-f32(k));
    let a2 = alpha * alpha;

    // Walk the tree depth first.
    var sum = vec3f(0.0);
    var weights = 0.0;
    var level = TOP_LEVEL;
    var cell = 0u;   // in its level
    while (level < TOP_LEVEL || cell < TOP_CELLS) {
        let index = first_cell(level) + cell;
        let width = cell_width(level);
        let centre = cells[index].centre.xyz;
        let apart = centre - d;
        let squared = dot(apart, apart);
        let cosine = 1.0 - 0.5 * squared;
        let is_below = cosine < -1.5 * width;
        let meets_horizon = abs(cosine) < width;
        let limit = min(LARGEST_WIDTH / alpha, RELATIVE_WIDTH * sqrt(4.0 * a2 + squared));
        if (level > 0u && !is_below && width > select(limit, min(limit, HORIZON_WIDTH / alpha), meets_horizon)) {
            level -= 1u;
            cell *= 4u;
            continue;
        }
        if (cosine > 0.0) {
            // As ggx_distribution, whose cos_h^2 is (1 + cosine) / 2.
            let t = 0.25 * squared + a2 * (1.0 - 0.25 * squared);
            let weight = cosine * a2 / (t * t);
            let light = cells[index].light;
            sum += weight * light.rgb;
            weights += weight * light.a;
        }
        // Go on with the next cell; from the last of four with the one after their parent.
        cell += 1u;
        let up = min(countTrailingZeros(cell) / 2u, TOP_LEVEL - level);
        cell >>= 2u * up;
        level += up;
    }
    textureStore(maps, id.xy, vec4f(sum / max(weights, 1e-30), 1.0));
}
