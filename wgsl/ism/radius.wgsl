// How far a point of a map reaches.
#import "ism/map.wgsl"
#import "points/table.wgsl"

override PER_MAP: u32 = 0u;   // points of all surfaces in a map
override SPACING: f32 = 4.0;  // texels between rays

// Returns the radius in texels that a point stands for: that of its share of the area, or of a ray's share of the
// hemisphere where that is less.
fn point_radius(code: f32) -> f32 {
    if (PER_MAP == 0u) {
        return SPACING;
    }
    let distance = 2.0 * scene.radius * exp2(-0.5 * (code - 1.0) / CODES_PER_OCTAVE);
    let radius = bitcast<f32>(points[1u].x) * sqrt(f32(point_count()) / f32(PER_MAP));
    return min(radius / distance * (f32(ISM_RESOLUTION) / 2.5), SPACING);
}
