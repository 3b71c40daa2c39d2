// How the slots of VPLs are dealt out to classes of pixels: class c of n^2 has the slots c, c + n^2, c + 2 n^2, ...
// Sets of them are bits: word w of a class has those of its slots number 32 w to 32 w + 31.
#import "common/interleave.wgsl"

fn words_per_class(vpl_count: u32) -> u32 {
    return (vpl_count + 32u * class_count() - 1u) / (32u * class_count());
}

// Returns how many words hold the slots of one class: those of a few classes may be one less.
fn words_of_class(vpl_count: u32, class_number: u32) -> u32 {
    return (slots_of_class(vpl_count, class_number) + 31u) / 32u;
}

fn slots_of_class(vpl_count: u32, class_number: u32) -> u32 {
    return (vpl_count + class_count() - 1u - class_number) / class_count();
}

fn slot_of(class_number: u32, number: u32) -> u32 {
    return number * class_count() + class_number;
}

// Returns the bits of those slots of a word that there are.
fn slots_of_word(vpl_count: u32, class_number: u32, word: u32) -> u32 {
    let slots = slots_of_class(vpl_count, class_number);
    let left = select(0u, slots - 32u * word, slots > 32u * word);
    return select((1u << (left & 31u)) - 1u, 0xffffffffu, left >= 32u);
}
