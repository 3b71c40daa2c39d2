// The fall-off of spots: KHR_lights_punctual's saturate((cos - cos_outer) / (cos_inner - cos_outer))^2.
//
// Written with the versine v = 1 - cos = |d - axis|^2 / 2, whose relative error stays small in narrow cones: cosines
// have steps of 6e-8, a sixth of the versine of 0.05 degrees.

// Returns the fall-off, saturate(offset - scale v)^2, in a unit direction from the light.
fn spot_falloff(from_light: vec3f, axis: vec3f, scale: f32, offset: f32) -> f32 {
    let apart = from_light - axis;
    let linear = saturate(offset - scale * 0.5 * dot(apart, apart));
    return linear * linear;
}
