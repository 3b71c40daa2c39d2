// One invocation sums the leaves of one cell of the quadtree's upper levels.
//
// In: the cells of level 0. Out: those of levels 1 to TOP_LEVEL. Means are kept to the rounding of a sum of 1024 terms.
#import "environment/cells.wgsl"

@group(1) @binding(11) var<storage, read_write> cells: array<Cell>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let cell = LEAVES + id.x;
    if (cell >= CELLS) {
        return;
    }
    var level = 1u;
    while (level < TOP_LEVEL && cell >= first_cell(level + 1u)) {
        level += 1u;
    }
    let first_leaf = (cell - first_cell(level)) << (2u * level);
    var light = vec4f(0.0);
    var by_light = vec3f(0.0);
    var by_angle = vec3f(0.0);
    for (var leaf = first_leaf; leaf < first_leaf + (1u << (2u * level)); leaf += 1u) {
        let part = cells[leaf];
        light += part.light;
        by_light += luminance(part.light.rgb) * part.centre.xyz;
        by_angle += part.light.a * part.centre.xyz;
    }
    cells[cell] = Cell(light, vec4f(cell_centre(by_light, by_angle), 0.0));
}
