// The radius by which pull-push spreads a surface point or a ray's hit in a map.
#import "many_light/ism/map.wgsl"
#import "many_light/points/table.wgsl"

override RAY_SPACING: u32 = 8u;  // texels between rays

const RAY_RADIUS: f32 = 0.5;  // of a ray, over the spacing: half-way to the next ray

// Returns the radius in texels of a disc with a point's share of all surface area, seen face-on from `distance` metres.
// Without points in the maps (`points_per_map` = 0) it is the radius of a ray.
fn point_radius(distance: f32, points_per_map: u32) -> f32 {
    if (points_per_map == 0u) {
        return RAY_RADIUS * f32(RAY_SPACING);
    }
    let radius = bitcast<f32>(points[1u].x) * sqrt(f32(point_count()) / f32(points_per_map));
    return radius / distance * (f32(ISM_RESOLUTION) / TEXEL_ANGLE);
}
