// One invocation traces a row of rays from a VPL, to corners of cells of its map, and keeps the triangles that they hit.
//
// In: the VPLs, the scene. Out, for pull-push: the texels that their points fall on, at the far end where a ray leaves
// the scene. Out, else: points, three vec4f each in the frame of the map: (m, distance in metres or 0 where the ray
// leaves the scene), (row 0, whether the triangle is larger than a cell), (row 1, its width in cells).
#import "many_light/ism/facet.wgsl"

@group(1) @binding(11) var<storage, read_write> near_points: array<vec4f>;
@group(1) @binding(13) var<storage, read_write> drawn: array<atomic<u32>>;

override CELL: u32 = 4u;       // texels between rays
override SINGLE: bool = true;  // draw each point as a single texel

@group(1) @binding(19) var<uniform> params: Params;

struct Params {
    vpl_count: u32,
    atlas_width: u32,  // texels
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let side = ISM_RESOLUTION / CELL + 1u;
    let slot = id.x / side;
    let row = id.x % side;
    if (slot >= params.vpl_count) {
        return;
    }
    let vpl = load_vpl(slot);
    if (max3(vpl.flux) <= 0.0) {
        return;
    }
    let frame = frame_from_normal(vpl.normal);
    let first = id.x * side;
    for (var k = 0u; k < side; k += 1u) {
        let local = ray_direction(vec2f(vec2u(k, row) * CELL));
        let facet = trace_facet(vpl, frame, local);
        if (SINGLE) {
            // Of what meets nothing, a texel at the far end.
            let place = ray_texel(vec2u(k, row) * CELL);
            let at = map_corner(slot, params.atlas_width) + place;
            let texel = max(plane_texel(map_direction(vec2f(place) + 0.5), facet.plane), 1u << 16u);
            atomicMax(&drawn[at.y * params.atlas_width + at.x], texel);
            continue;
        }
        let out = 3u * (first + k);
        let spacing = 2.5 * f32(CELL) / f32(ISM_RESOLUTION);
        near_points[out] = vec4f(facet.plane, facet.distance);
        near_points[out + 1u] = vec4f(facet.row0, select(0.0, 1.0, facet.width > spacing));
        near_points[out + 2u] = vec4f(facet.row1, facet.width / spacing);
    }
}
