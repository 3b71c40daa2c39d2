// One invocation splats one surface point into one imperfect shadow map (Ritschel et al. 2008): the texels
// of a disc, each with the plane of the disc and its distance.
//
// Map k takes the n points from k n on (modulo their number); discs grow to cover the area of the points left out:
// radius = splat_scale * radius of the point's area * sqrt(points / n). In: points and VPLs, metres. Out: `samples`,
// for each texel the nearest disc. Errs dark at silhouettes, which discs overlap, and bright where discs leave gaps.
#import "many_light/ism/map.wgsl"
#import "many_light/points/table.wgsl"

@group(1) @binding(11) var<storage, read_write> samples: array<atomic<u32>>;
@group(1) @binding(19) var<uniform> params: Params;

struct Params {
    points_per_map: u32,
    atlas_width: u32,   // texels
    max_radius: f32,    // of a splat, texels; 0: single texels
    splat_scale: f32,   // radius of a splat over the radius of the area that it represents
}

// Sine of the least angle between a ray and the surface of the VPL or of the point. Below it, rounding of 16-bit
// normals (1e-4) and of positions dominates the plane and distance of a splat.
const MIN_SINE: f32 = 1e-3;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let slot = id.y;
    if (id.x >= params.points_per_map) {
        return;
    }
    // Place the point in the frame of the map.
    let vpl = load_vpl(slot);
    let count = point_count();
    let point = load_point((slot * params.points_per_map + id.x) % count);
    let frame = frame_from_normal(vpl.normal);
    let v = (point.position - vpl.position) * frame;
    let distance = length(v);
    let normal = point.normal * frame;
    let facing = dot(normal, v);
    // Skip points behind the VPL or in its plane, and discs seen edge-on.
    if (point.open || max3(vpl.flux) <= 0.0 || v.z <= MIN_SINE * distance || abs(facing) <= MIN_SINE * distance) {
        return;
    }
    // Bound the disc in the map.
    let m = normal / facing;
    let radius = params.splat_scale * point.radius * sqrt(f32(count) / f32(params.points_per_map));
    let place = (hemisphere_encode(v / distance) * 0.5 + 0.5) * f32(ISM_RESOLUTION);
    let reach = min(radius / distance * (f32(ISM_RESOLUTION) / TEXEL_ANGLE), params.max_radius);
    let low = vec2u(max(place - reach, vec2f(0.0)));
    let high = vec2u(min(place + reach, vec2f(f32(ISM_RESOLUTION) - 1.0)));
    let corner = map_corner(slot, params.atlas_width);
    let home = vec2u(min(place, vec2f(f32(ISM_RESOLUTION) - 1.0)));
    // Keep the nearest disc in each texel. A disc covers the texels whose rays meet it, and always the texel of its
    // centre.
    for (var y = low.y; y <= high.y; y += 1u) {
        for (var x = low.x; x <= high.x; x += 1u) {
            let w = map_direction(vec2f(vec2u(x, y)) + 0.5);
            let off = w / dot(m, w) - v;
            if (dot(off, off) <= radius * radius || all(vec2u(x, y) == home)) {
                let texel = plane_texel(w, m);
                let index = (corner.y + y) * params.atlas_width + corner.x + x;
                if (texel > atomicLoad(&samples[index])) {
                    atomicMax(&samples[index], texel);
                }
            }
        }
    }
}
