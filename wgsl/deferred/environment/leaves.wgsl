// One invocation integrates the environment map over one cell of the quadtree's finest level.
//
// integral L dw and integral L w dw by the midpoint rule over a grid that divides each pixel, or over the pixels
// themselves where the map is finer than the cells; weights are the grid's exact solid angles. In: the map, bilinear as
// rays see it. Out: the cells of level 0, W/m2. Errs by the curvature of radiance within a step, either way.
#import "scene/environment.wgsl"
#import "deferred/environment/cells.wgsl"

@group(1) @binding(11) var<storage, read_write> cells: array<Cell>;

// Returns the grid's steps per pixel along an axis, such that there are at least as many steps as leaves. An even
// number keeps the kinks of bilinear interpolation, at the pixels' centres, out of the steps.
fn steps_per_pixel(pixels: u32, leaves: u32) -> u32 {
    return select(2u * ((leaves / 2u + pixels - 1u) / pixels), 1u, pixels >= leaves);
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let leaf = id.xy;
    let size = textureDimensions(environment);
    let per_pixel = vec2u(steps_per_pixel(size.x, LEAVES_X), steps_per_pixel(size.y, LEAVES_Y));
    let steps = size * per_pixel;
    let begin = leaf * steps / vec2u(LEAVES_X, LEAVES_Y);
    let end = (leaf + 1u) * steps / vec2u(LEAVES_X, LEAVES_Y);
    let angle = vec2f(TWO_PI, PI) / vec2f(steps);  // of a step, in longitude and latitude

    var light = vec4f(0.0);
    var by_light = vec3f(0.0);
    var by_angle = vec3f(0.0);
    for (var y = begin.y; y < end.y; y += 1u) {
        let theta = (f32(y) + 0.5) * angle.y;
        let solid_angle = 2.0 * sin(theta) * sin(0.5 * angle.y) * angle.x;
        for (var x = begin.x; x < end.x; x += 1u) {
            let phi = (f32(x) + 0.5) * angle.x;
            let direction = vec3f(sin(phi) * sin(theta), cos(theta), -cos(phi) * sin(theta));
            let flux = picture_at((vec2f(vec2u(x, y)) + 0.5) / vec2f(per_pixel)) * solid_angle;
            light += vec4f(flux, solid_angle);
            by_light += luminance(flux) * direction;
            by_angle += solid_angle * direction;
        }
    }
    let index = LEAVES + (spread_bits(leaf.x) | (spread_bits(leaf.y) << 1u));
    cells[index] = Cell(light, vec4f(cell_centre(by_light, by_angle), 0.0));
}
