// Contact shadows: shadows of small objects, which the shadow map's bias loses (Ritschel et al. 2009, section 5). The
// test marches from the surface towards the light, over the bias' length, through the main camera's layers.
//
// Errs dark behind thin objects with a single layer, by the bias at most; misses objects outside the picture.
#import "ssdo/depth_test.wgsl"

override CONTACT_POINTS: u32 = 8u;  // points of the march

// Returns 0 if an occluder lies within `bias` metres of a position in the unit direction `to_light`, else 1.
fn contact_visibility(position: vec3f, normal: vec3f, to_light: vec3f, bias: f32) -> f32 {
    let r = receiver_in_view(view_0, position, frame_from_normal(to_light), frame_from_normal(normal));
    let advance = dot(view_0.forward, to_light) * bias / f32(CONTACT_POINTS);
    var visible = 1.0;
    for (var k = 0u; k < CONTACT_POINTS; k += 1u) {
        let t = bias * (f32(k) + 1.0) / f32(CONTACT_POINTS);
        let test = test_layers(r, project_point(r, r.axes[2], t), advance);
        // An occluder more than `bias` in front of the point is not near the surface.
        visible = select(visible, 0.0, test.behind <= bias);
    }
    return visible;
}
