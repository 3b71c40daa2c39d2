// How the slots of VPLs are dealt out to classes of pixels: class c of n^2 has the slots c, c + n^2, c + 2 n^2, ...
// Sets of them are bits: word w of a class has those of its slots number 32 w to 32 w + 31.

override INTERLEAVE: u32 = 4u;  // n
override VPLS: u32 = 1024u;     // slots of the table

fn class_count() -> u32 {
    return INTERLEAVE * INTERLEAVE;
}

// Has no common divisor with the square of an INTERLEAVE of up to 8.
const CLASS_STEP: u32 = 11u;

// Returns the class whose VPLs a pixel sees: they go round from frame to frame of a still picture, so that in the mean
// each pixel sees all of them.
fn class_of(pixel: vec2u, frame: u32) -> u32 {
    let own = pixel % INTERLEAVE;
    return (own.y * INTERLEAVE + own.x + frame * CLASS_STEP) % class_count();
}

fn words_per_class() -> u32 {
    return (VPLS + 32u * class_count() - 1u) / (32u * class_count());
}

fn slot_of(class_number: u32, number: u32) -> u32 {
    return number * class_count() + class_number;
}

// Returns the bits of those slots of a word that there are.
fn slots_of_word(class_number: u32, word: u32) -> u32 {
    let slots = (VPLS + class_count() - 1u - class_number) / class_count();
    let left = select(0u, slots - 32u * word, slots > 32u * word);
    return select((1u << (left & 31u)) - 1u, 0xffffffffu, left >= 32u);
}
