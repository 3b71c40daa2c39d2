// The G-buffer's words of 16 bytes for each pixel.
#import "common/layers.wgsl"

fn gbuffer_stride() -> u32 {
    return select(1u, 3u, HAS_LAYERS);
}
