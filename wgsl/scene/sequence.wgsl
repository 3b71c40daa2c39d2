// The number of the frame of a still picture: frames of one picture draw other random numbers. Apart from the camera,
// so that what does not depend on it is kept while it moves.

struct Sequence {
    index: u32,
    ahead: u32,  // frames before the first one that counts, in which light that goes round settles; their index is 0
}

@group(0) @binding(3) var<uniform> sequence: Sequence;
