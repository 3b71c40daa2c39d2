// The uniforms of a run of the path tracer; what an adaptive run traces, and reports.
#import "reference/learned.wgsl"

struct Params {
    settle_index: u32,    // runs since the picture last changed; 0 starts over
    first_workgroup: u32,
    samples: u32,         // paths per pixel and run
    spp: u32,             // paths per pixel in all; adaptive: their mean
    bounces: u32,         // indirect bounces; scatterings are one more
    seed: u32,
    row_stride: u32,      // coprime to the rows of tiles
}

@group(1) @binding(11) var<uniform> params: Params;

// Returns how many paths an adaptive run traces for a pixel that has `done`.
fn adaptive_paths(pixel: vec2u, done: u32) -> u32 {
    let planned = paths_of(pixel, mean_paths(params.settle_index, params.samples, params.spp));
    return planned - min(done, planned);
}

// Reports the number of an adaptive run, and a pixel that still lacks paths after it.
fn report_run(pixel: vec2u, done: u32) {
    if (all(pixel == vec2u(0u))) {
        atomicStore(&learned[LAST_RUN], params.settle_index);
    }
    let planned = paths_of(pixel, mean_paths(params.settle_index, params.samples, params.spp));
    if (done < planned) {
        atomicMax(&learned[MISSING], planned - done);
    }
}
