// One invocation draws one point into one map: the texels of a disc, each at the distance of the disc's own plane.
//
// Each map takes another part of the points, in turn, and their discs grow by what is left out; so a point goes into
// several maps. In: points, VPLs. Out: the nearest of the discs for each texel. Errs dark at silhouettes, which discs
// overlap, and bright where discs leave gaps.
#import "many_light/ism/map.wgsl"
#import "many_light/points/table.wgsl"

@group(1) @binding(11) var<storage, read_write> drawn: array<atomic<u32>>;

@group(1) @binding(19) var<uniform> params: Params;

struct Params {
    per_map: u32,      // points of a map
    atlas_width: u32,  // texels
    footprint: f32,    // texels to which a disc is cut off around its centre; 0: draw single texels
    grow: f32,         // radius of a disc over that of its share of the area
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let slot = id.y;
    if (id.x >= params.per_map) {
        return;
    }
    let vpl = load_vpl(slot);
    let count = point_count();
    let point = load_point((slot * params.per_map + id.x) % count);
    let frame = frame_from_normal(vpl.normal);
    let v = (point.position - vpl.position) * frame;
    let distance = length(v);
    let normal = point.normal * frame;
    let facing = dot(normal, v);
    // Leave out what lies behind the VPL or in its own plane, and what is seen edge-on.
    if (max3(vpl.flux) <= 0.0 || v.z <= 1e-3 * distance || abs(facing) <= 1e-3 * distance) {
        return;
    }
    let m = normal / facing;
    let radius = params.grow * point.radius * sqrt(f32(count) / f32(params.per_map));
    let place = (hemisphere_encode(v / distance) * 0.5 + 0.5) * f32(ISM_RESOLUTION);
    // A texel spans 2.5 / resolution on average: sqrt(2 pi).
    let reach = min(radius / distance * (f32(ISM_RESOLUTION) / 2.5), params.footprint);
    let low = vec2u(max(place - reach, vec2f(0.0)));
    let high = vec2u(min(place + reach, vec2f(f32(ISM_RESOLUTION) - 1.0)));
    let corner = map_corner(slot, params.atlas_width);
    let home = vec2u(min(place, vec2f(f32(ISM_RESOLUTION) - 1.0)));
    for (var y = low.y; y <= high.y; y += 1u) {
        for (var x = low.x; x <= high.x; x += 1u) {
            let w = map_direction(vec2f(vec2u(x, y)) + 0.5);
            let off = w / dot(m, w) - v;
            if (dot(off, off) <= radius * radius || all(vec2u(x, y) == home)) {
                let texel = plane_texel(w, m);
                let index = (corner.y + y) * params.atlas_width + corner.x + x;
                if (texel > atomicLoad(&drawn[index])) {
                    atomicMax(&drawn[index], texel);
                }
            }
        }
    }
}
