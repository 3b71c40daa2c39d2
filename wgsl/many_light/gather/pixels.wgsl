// Deinterleaving: the pixels that a thread gathers for. The pixels of a class lie INTERLEAVE apart, so each square of
// INTERLEAVE x INTERLEAVE pixels has one of each class (Segovia et al. 2006, "Non-interleaved Deferred Shading of
// Interleaved Sample Patterns"; Linke 2016, sections 3.4 and 4.5).
//
// Departures from Segovia: index arithmetic instead of splitting and merging buffers; classes rotate from frame to
// frame of a still picture, so each pixel's mean covers all VPLs.
#import "many_light/gather/classes.wgsl"
#import "scene/sequence.wgsl"

// A workgroup takes pixels of one class, each thread PIXELS of them in a column: CPUs run 8 threads of a row in
// parallel, so that these cover a block of 8 x 4.
const GROUP_X: u32 = 8u;
const GROUP_Y: u32 = 8u;
const PIXELS: u32 = 4u;

struct Place {
    pixel: vec2u,         // the first of the grid; the others follow INTERLEAVE rows apart
    class_number: u32,    // of their VPLs, below INTERLEAVE^2
}

// Returns the pixels of a thread. Workgroups go through a band of the picture class by class, so that the maps of a
// class' VPLs and the band's part of the G-buffer stay in caches.
fn place_of(group: vec3u, thread: vec3u) -> Place {
    let own = group.y % class_count();
    let block = vec2u(group.x, group.y / class_count()) * vec2u(GROUP_X, GROUP_Y) + thread.xy;
    let offset = vec2u(own % INTERLEAVE, own / INTERLEAVE);
    return Place(block * vec2u(1u, PIXELS) * INTERLEAVE + offset, class_of(offset, sequence.index));
}
