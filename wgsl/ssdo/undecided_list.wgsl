// Read access to the list of undecided directions, and the pixels that they leave.
#import "shared/upsample/grid_pixel.wgsl"
#import "ssdo/hit_code.wgsl"
#import "shared/upsample/unrepresented.wgsl"

override DIRECTIONS: u32 = 1u;         // per pixel
override LOBES: u32 = 0u;              // further directions of coated pixels
override UNREPRESENTED: bool = false;  // directions of unrepresented pixels

@group(1) @binding(15) var<storage, read> undecided: array<u32>;

const LIST_START: u32 = 8u;  // words before the list

fn undecided_count() -> u32 {
    return undecided[3];
}

// Returns the index of a direction's entry in `hits`.
fn undecided_index(place: u32) -> u32 {
    return undecided[LIST_START + place];
}

// Returns the number of the pixel that an entry of `hits` belongs to.
fn slot_of(index: u32) -> u32 {
    return index / (DIRECTIONS + LOBES);
}

// Returns the pixel of a slot.
fn pixel_of_slot(slot: u32) -> vec2u {
    if (UNREPRESENTED) {
        let index = unrepresented[slot];
        return vec2u(index % view.size.x, index / view.size.x);
    }
    return grid_pixel(vec2u(slot % grid_size().x, slot / grid_size().x));
}
