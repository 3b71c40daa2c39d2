// One end of a way that light takes.

struct Place {
    pixel: vec2i,     // of the level
    position: vec3f,  // metres from the camera, along the axes of the world
    normal: vec3f,    // unit, towards the viewer
}
