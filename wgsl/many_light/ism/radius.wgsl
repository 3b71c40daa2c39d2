// How far a point of a map reaches.
#import "many_light/ism/map.wgsl"
#import "many_light/points/table.wgsl"

override SPACING: u32 = 8u;  // texels between rays

const RAY_RADIUS: f32 = 0.5;  // to which a ray reaches, in spacings: there the next one begins

// Returns the radius in texels of a disc of a point's share of all surfaces, seen from before it; that of a ray where
// only rays find points. `per_map`: points of all surfaces in a map.
fn point_radius(distance: f32, per_map: u32) -> f32 {
    if (per_map == 0u) {
        return RAY_RADIUS * f32(SPACING);
    }
    let radius = bitcast<f32>(points[1u].x) * sqrt(f32(point_count()) / f32(per_map));
    return radius / distance * (f32(ISM_RESOLUTION) / 2.5);
}
