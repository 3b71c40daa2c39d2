// Votes: many rays hit a cell in a frame, and the hit with the largest vote updates it. Votes are a permutation of the
// hits' numbers, another one in each frame, so the choice is random, the same on every machine, and can be undone.
#import "common/random.wgsl"

// Returns the odd factor of a frame.
fn vote_multiplier(frame: u32, seed: u32) -> u32 {
    return hash2(frame, seed) | 1u;
}

// Returns the vote of a hit, not 0.
fn vote_of(hit: u32, multiplier: u32) -> u32 {
    return (hit + 1u) * multiplier;
}

// Returns the hit of a vote.
fn hit_of_vote(vote: u32, multiplier: u32) -> u32 {
    // Newton's iteration doubles the number of right bits of the inverse; m is right in its lowest three.
    var inverse = multiplier;
    for (var k = 0u; k < 4u; k += 1u) {
        inverse *= 2u - multiplier * inverse;
    }
    return vote * inverse - 1u;
}
