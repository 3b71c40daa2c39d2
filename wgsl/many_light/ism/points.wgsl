// One invocation draws one point into one map: the texels of a disc, each at the distance of the disc's own plane.
//
// Each map takes another part of the points, in turn, and their discs grow by what is left out; so a point goes into
// several maps. In: points, VPLs. Out: the nearest of the discs for each texel. Errs dark at silhouettes, which discs
// overlap, and bright where discs leave gaps.
#import "many_light/ism/map.wgsl"
#import "many_light/points/table.wgsl"

@group(1) @binding(11) var<storage, read_write> drawn: array<atomic<u32>>;

override PER_MAP: u32 = 1024u;
override FOOTPRINT: f32 = 3.0;  // texels to which a disc is cut off around its centre; 0: draw single texels
override GROW: f32 = 1.0;     // radius of a disc over that of its share of the area

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let slot = id.y;
    if (id.x >= PER_MAP) {
        return;
    }
    let vpl = load_vpl(slot);
    let count = point_count();
    let point = load_point((slot * PER_MAP + id.x) % count);
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
    let radius = GROW * point.radius * sqrt(f32(count) / f32(PER_MAP));
    let place = (hemisphere_encode(v / distance) * 0.5 + 0.5) * f32(ISM_RESOLUTION);
    // A texel spans 2.5 / resolution on average: sqrt(2 pi).
    let reach = min(radius / distance * (f32(ISM_RESOLUTION) / 2.5), FOOTPRINT);
    let low = vec2u(max(place - reach, vec2f(0.0)));
    let high = vec2u(min(place + reach, vec2f(f32(ISM_RESOLUTION) - 1.0)));
    let corner = map_corner(slot);
    let home = vec2u(min(place, vec2f(f32(ISM_RESOLUTION) - 1.0)));
    for (var y = low.y; y <= high.y; y += 1u) {
        for (var x = low.x; x <= high.x; x += 1u) {
            let w = map_direction(vec2f(vec2u(x, y)) + 0.5);
            let off = w / dot(m, w) - v;
            if (dot(off, off) <= radius * radius || all(vec2u(x, y) == home)) {
                let texel = plane_texel(w, m);
                let index = (corner.y + y) * ISM_COLUMNS * ISM_RESOLUTION + corner.x + x;
                if (texel > atomicLoad(&drawn[index])) {
                    atomicMax(&drawn[index], texel);
                }
            }
        }
    }
}
