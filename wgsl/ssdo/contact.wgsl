// Shadows of small things that a shadow map's bias lost, found in screen space (Ritschel et al. 2009, section 5):
// points on the segment from a surface towards the light, as long as the bias is, against the depth buffer.
//
// Errs dark behind what is thin in a single layer, by the bias at most, and finds nothing that the picture does not show.
#import "ssdo/look.wgsl"

override CONTACT_POINTS: u32 = 8u;  // on the segment

// Returns 0 if something stands within `bias` metres of a position in the unit direction `to_light`, else 1.
fn contact_visibility(position: vec3f, normal: vec3f, to_light: vec3f, bias: f32) -> f32 {
    let m = in_view(view_0, position, frame_from_normal(to_light), frame_from_normal(normal));
    let advance = dot(view_0.forward, to_light) * bias / f32(CONTACT_POINTS);
    var visible = 1.0;
    for (var k = 0u; k < CONTACT_POINTS; k += 1u) {
        let way = bias * (f32(k) + 1.0) / f32(CONTACT_POINTS);
        let at = point_on(m, m.axes[2], way);
        let seen = look_at_layers(m, at, advance);
        // What is farther before the point than the segment is long is no part of what stands there.
        visible = select(visible, 0.0, seen.gap <= bias);
    }
    return visible;
}
