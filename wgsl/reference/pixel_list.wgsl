// One invocation traces `samples` more paths of one entry of a list of pixels, as `reference/path.wgsl` does for a picture.
//
// An entry is a pixel and a seed, so that a pixel may be listed several times with independent random numbers. In: the
// scene, the list, and the means so far. Out: means and squared deviations as of `path.wgsl`, an element an entry.
// Unbiased as the path tracer is.
#import "reference/path.wgsl"

struct PixelList {
    entries: array<vec4u, 4096>,  // x, y, seed, -; entries outside the picture are ignored
}

@group(0) @binding(10) var<uniform> pixel_list: PixelList;

@compute @workgroup_size(64)
fn main_listed(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let index = (params.first_workgroup + workgroup.x) * 64u + local;
    let entry = pixel_list.entries[min(index, 4095u)];
    if (all(entry.xy < view.size)) {
        trace_paths(whole_pixel(entry.xy), index, entry.z);
    }
}
