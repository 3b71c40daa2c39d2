// The frame's number within a still picture; it selects the frame's random numbers. It is a separate uniform, so passes
// that do not depend on the camera keep their results while the camera moves.

struct Sequence {
    index: u32,
    ahead: u32,  // remaining warm-up frames, in which light of several bounces settles; `index` is 0 in them
}

@group(0) @binding(3) var<uniform> sequence: Sequence;
