// One invocation traces one ray from a VPL, to a corner of a cell of its map, and keeps the triangle that it hits.
//
// In: the VPLs, the scene. Out, for pull-push: the texel that a point falls on. Out, else: points, three vec4f each in
// the frame of the map: (m, distance in metres or 0 where the ray leaves the scene), (row 0, whether the triangle is
// larger than a cell), (row 1, its width in cells).
#import "ism/facet.wgsl"

@group(1) @binding(11) var<storage, read_write> near_points: array<vec4f>;
@group(1) @binding(12) var<storage, read_write> drawn: array<atomic<u32>>;

override CELL: u32 = 4u;       // texels between rays
override SINGLE: bool = true;  // draw each point as a single texel

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let side = ISM_RESOLUTION / CELL + 1u;
    let slot = id.y;
    let corner = vec2f(vec2u(id.x % side, id.x / side) * CELL);
    // Of a cell that sees a part of the hemisphere, all corners are within its diagonal.
    if (id.x >= side * side || is_below_horizon(corner, 1.5 * f32(CELL))) {
        return;
    }
    let vpl = load_vpl(slot);
    if (max3(vpl.flux) <= 0.0) {
        return;
    }
    let local = ray_direction(corner);
    let facet = facet_met(vpl, local);
    if (SINGLE) {
        if (facet.distance > 0.0) {
            let point = (hemisphere_encode(local) * 0.5 + 0.5) * f32(ISM_RESOLUTION);
            let place = min(vec2u(point), vec2u(ISM_RESOLUTION - 1u));
            let at = map_corner(slot) + place;
            let texel = plane_texel(map_direction(vec2f(place) + 0.5), facet.plane);
            atomicMax(&drawn[at.y * ISM_COLUMNS * ISM_RESOLUTION + at.x], texel);
        }
        return;
    }
    let out = 3u * (slot * side * side + id.x);
    let spacing = 2.5 * f32(CELL) / f32(ISM_RESOLUTION);
    near_points[out] = vec4f(facet.plane, facet.distance);
    near_points[out + 1u] = vec4f(facet.row0, select(0.0, 1.0, facet.width > spacing));
    near_points[out + 2u] = vec4f(facet.row1, facet.width / spacing);
}
