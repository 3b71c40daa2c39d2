// A surface that the camera sees. A few of them estimate the share of a candidate's light that reaches the view.

struct ViewSample {
    position: vec3f,  // metres relative to the scene's origin
    weight: f32,      // 1, or 0 where the pixel shows no surface
    normal: vec3f,    // shading, unit
    pad: f32,
}
