// The frame's number within a still picture: each frame draws other random numbers. A uniform of its own, so that
// passes that do not depend on the camera keep their results while it moves.

struct Sequence {
    index: u32,
    ahead: u32,  // frames left of the warm-up, in which light of several bounces settles; `index` is 0 during it
}

@group(0) @binding(3) var<uniform> sequence: Sequence;
