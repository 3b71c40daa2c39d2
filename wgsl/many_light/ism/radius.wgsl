// How far a point of a map reaches.
#import "many_light/ism/map.wgsl"
#import "many_light/points/table.wgsl"

override PER_MAP: u32 = 0u;  // points of all surfaces in a map
override SPACING: u32 = 8u;  // texels between rays

const RAY_RADIUS: f32 = 0.5;  // to which a ray reaches, in spacings: there the next one begins

// Returns the radius in texels of a disc of a point's share of all surfaces, seen from before it; that of a ray where
// only rays find points.
fn point_radius(distance: f32) -> f32 {
    if (PER_MAP == 0u) {
        return RAY_RADIUS * f32(SPACING);
    }
    let radius = bitcast<f32>(points[1u].x) * sqrt(f32(point_count()) / f32(PER_MAP));
    return radius / distance * (f32(ISM_RESOLUTION) / 2.5);
}
