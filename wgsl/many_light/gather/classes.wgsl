// Interleaved sampling (Keller and Heidrich 2001): the VPLs of each class of pixels. Class c of n^2 has the slots c, c
// + n^2, c + 2 n^2, ... of the table.
//
// Subsets of a class are bit masks: word w holds its slots number 32 w to 32 w + 31.
#import "common/interleave.wgsl"

// Returns the number of words per class in a light list.
fn words_per_class(vpl_count: u32) -> u32 {
    return (vpl_count + 32u * class_count() - 1u) / (32u * class_count());
}

// Returns the number of words that the slots of one class fill. It differs by at most one word between classes.
fn words_of_class(vpl_count: u32, class_number: u32) -> u32 {
    return (slots_of_class(vpl_count, class_number) + 31u) / 32u;
}

fn slots_of_class(vpl_count: u32, class_number: u32) -> u32 {
    return (vpl_count + class_count() - 1u - class_number) / class_count();
}

// Returns the slot of a class' VPL number k.
fn slot_of(class_number: u32, k: u32) -> u32 {
    return k * class_count() + class_number;
}

// Returns the mask of all slots of a word.
fn slots_of_word(vpl_count: u32, class_number: u32, word: u32) -> u32 {
    let slots = slots_of_class(vpl_count, class_number);
    let left = select(0u, slots - 32u * word, slots > 32u * word);
    return select((1u << (left & 31u)) - 1u, 0xffffffffu, left >= 32u);
}
