// How the pixels of the picture are dealt out to threads.
//
// Pixels of a class lie INTERLEAVE apart, so that each square of INTERLEAVE x INTERLEAVE pixels has one of each class.
// Each class sees its own share of the VPLs (Segovia et al. 2006, "Non-interleaved Deferred Shading of Interleaved
// Sample Patterns"). Departures: by index arithmetic alone, nothing is split or merged; the classes' shares go round
// from frame to frame of a still picture, so that in the mean each pixel sees all VPLs.
#import "many_light/gather/classes.wgsl"
#import "scene/sequence.wgsl"

// A workgroup takes pixels of one class, each thread PIXELS of them, one below the other: CPUs run 8 threads of a row
// in step, so that these cover a block of 8 x 4.
const GROUP_X: u32 = 8u;
const GROUP_Y: u32 = 8u;
const PIXELS: u32 = 4u;

struct Place {
    pixel: vec2u,         // the first; the others lie INTERLEAVE below each other
    class_number: u32,    // whose VPLs they see, below INTERLEAVE^2
}

// Workgroups go through a band of the picture by one class after the other: the maps of a class' VPLs, and the band's
// part of the G-buffer, then stay in caches.
fn place_of(group: vec3u, thread: vec3u) -> Place {
    let own = group.y % class_count();
    let block = vec2u(group.x, group.y / class_count()) * vec2u(GROUP_X, GROUP_Y) + thread.xy;
    let offset = vec2u(own % INTERLEAVE, own / INTERLEAVE);
    return Place(block * vec2u(1u, PIXELS) * INTERLEAVE + offset, class_of(offset, sequence.index));
}
