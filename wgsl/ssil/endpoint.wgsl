// One end of a segment along which light travels: receiver or sample.

struct Endpoint {
    pixel: vec2i,     // of the level
    position: vec3f,  // metres from the camera, world axes
    normal: vec3f,    // unit, towards the viewer
}
