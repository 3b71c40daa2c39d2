// Random numbers as hashes of (pixel, sample, dimension): no state, the same on every machine.

const ONE_OVER_2_32: f32 = 2.3283064365386963e-10;
const BELOW_ONE: f32 = 0.99999994;

// PCG output permutation of a linear step (Jarzynski and Olano 2020, "Hash Functions for GPU Rendering").
fn hash(value: u32) -> u32 {
    let state = value * 747796405u + 2891336453u;
    let word = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
    return (word >> 22u) ^ word;
}

fn hash2(a: u32, b: u32) -> u32 {
    return hash(a ^ hash(b));
}

fn unit_float(bits: u32) -> f32 {
    return min(f32(bits) * ONE_OVER_2_32, BELOW_ONE);
}

// Owen scrambling of a bit-reversed number: each bit depends only on lower bits
// (Laine and Karras 2011; constants by N. Vegdahl, as Burley 2020, "Practical Hash-based Owen Scrambling", recommends).
fn laine_karras(value: u32, seed: u32) -> u32 {
    var x = value;
    x ^= x * 0x3d20adeau;
    x += seed;
    x *= (seed >> 16u) | 1u;
    x ^= x * 0x05526c56u;
    x ^= x * 0x53a22864u;
    return x;
}

// Returns point `index` of an Owen-scrambled, shuffled Sobol (0,2)-sequence in [0, 1)^2. Each `seed` gives an
// independent scramble, so pairs of dimensions can be padded (Burley 2020, section 4).
fn sobol_2d(index: u32, seed: u32) -> vec2f {
    // Shuffle the index by an Owen scramble, which keeps every power-of-two prefix well distributed.
    let shuffled_reversed = laine_karras(reverseBits(index), hash(seed));
    // Dimension 0 is the van der Corput sequence: the index with its bits reversed.
    let x = laine_karras(reverseBits(shuffled_reversed), hash(seed ^ 0x68bc21ebu));
    // Dimension 1 has Pascal's triangle mod 2 as its matrix, applied here as five butterfly steps; bits come out
    // reversed.
    var w = reverseBits(shuffled_reversed);
    w ^= (w >> 1u) & 0x55555555u;
    w ^= (w >> 2u) & 0x33333333u;
    w ^= (w >> 4u) & 0x0f0f0f0fu;
    w ^= (w >> 8u) & 0x00ff00ffu;
    w ^= (w >> 16u) & 0x0000ffffu;
    let y = laine_karras(w, hash(seed ^ 0x02e5be93u));
    return vec2f(unit_float(reverseBits(x)), unit_float(reverseBits(y)));
}
