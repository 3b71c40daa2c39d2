// One invocation traces a row of rays from a VPL, through the corners of the cells of its map.
//
// In: VPLs, scene. Out, mode pull-push: `samples`, one texel per ray, with the farthest code where a ray leaves the
// scene. Out, mode splat: `ray_hits`, three vec4f per ray in the frame of the map: (plane m, distance in metres or 0
// where the ray leaves the scene), (row 0, 1 if the triangle is wider than a cell), (row 1, width in cells). Exact.
#import "many_light/ism/hit_triangle.wgsl"

@group(1) @binding(11) var<storage, read_write> ray_hits: array<vec4f>;
@group(1) @binding(13) var<storage, read_write> samples: array<atomic<u32>>;
@group(1) @binding(19) var<uniform> params: Params;

override RAY_SPACING: u32 = 4u;  // texels between rays
override SINGLE: bool = true;    // mode pull-push: single texels

struct Params {
    vpl_count: u32,
    atlas_width: u32,  // texels
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let side = ISM_RESOLUTION / RAY_SPACING + 1u;
    let slot = id.x / side;
    let row = id.x % side;
    if (slot >= params.vpl_count) {
        return;
    }
    let vpl = load_vpl(slot);
    if (max3(vpl.flux) <= 0.0) {
        return;
    }
    // Trace the rays of the row, and store their hits.
    let frame = frame_from_normal(vpl.normal);
    let first = id.x * side;
    for (var k = 0u; k < side; k += 1u) {
        let corner = vec2u(k, row) * RAY_SPACING;
        let triangle = trace_triangle(vpl, frame, ray_direction(vec2f(corner)));
        if (SINGLE) {
            let place = ray_texel(corner);
            let at = map_corner(slot, params.atlas_width) + place;
            let texel = max(plane_texel(map_direction(vec2f(place) + 0.5), triangle.plane), 1u << 16u);
            atomicMax(&samples[at.y * params.atlas_width + at.x], texel);
            continue;
        }
        let out = 3u * (first + k);
        let cell = TEXEL_ANGLE * f32(RAY_SPACING) / f32(ISM_RESOLUTION);
        ray_hits[out] = vec4f(triangle.plane, triangle.distance);
        ray_hits[out + 1u] = vec4f(triangle.row0, select(0.0, 1.0, triangle.width > cell));
        ray_hits[out + 2u] = vec4f(triangle.row1, triangle.width / cell);
    }
}
