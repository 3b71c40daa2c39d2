// The frame's random numbers, and its number within a still picture. It is a separate uniform, so passes that do not
// depend on the camera keep their results while the camera moves.
//
// There are two of them. `sequence`, for light that is averaged over moving frames: each frame draws new numbers.
// `still_sequence`, for everything else: frames that move draw the numbers of a still picture's first frame, so noise
// stands still, and virtual lights stay in place.

struct Sequence {
    index: u32,  // selects the frame's random numbers
    still: u32,  // frames of the still picture before this one; 0 while anything moves
    ahead: u32,  // remaining warm-up frames, in which light of several bounces settles; `index` is 0 in them
}

@group(0) @binding(3) var<uniform> sequence: Sequence;
