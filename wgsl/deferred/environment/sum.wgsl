// One invocation sums the leaves of one cell of the quadtree's upper levels.
//
// In: the cells of level 0. Out: those of levels 1 to TOP_LEVEL. Errs by the rounding of a sum of at most 1024 terms.
#import "deferred/environment/cells.wgsl"

@group(1) @binding(11) var<storage, read_write> cells: array<Cell>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    // Count through the cells of level 1, then those of level 2, and so on.
    var level = 1u;
    var cell = LEAVES / 4u + id.x;
    while (level <= TOP_LEVEL && cell >= 2u * (LEAVES >> (2u * level))) {
        cell = cell - 2u * (LEAVES >> (2u * level)) + (LEAVES >> (2u * level + 2u));
        level += 1u;
    }
    if (level > TOP_LEVEL) {
        return;
    }
    var light = vec4f(0.0);
    var by_light = vec3f(0.0);
    var by_angle = vec3f(0.0);
    let first_leaf = cell << (2u * level);
    for (var leaf = first_leaf; leaf < first_leaf + (1u << (2u * level)); leaf += 1u) {
        let part = cells[leaf];
        light += part.light;
        by_light += luminance(part.light.rgb) * part.centre.xyz;
        by_angle += part.light.a * part.centre.xyz;
    }
    cells[cell] = Cell(light, vec4f(cell_centre(by_light, by_angle), 0.0));
}
