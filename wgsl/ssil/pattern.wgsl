// One invocation places one sample of a pattern: where it lies about the pixel, and the area it stands for.
//
// The finest level takes the disc of radius r, the others the ring between r/2 and r (section 4). Each class of pixels
// has its own points; those of all 16 are one well-distributed set. Departure: in the disc the radius, not its square,
// is spread evenly, so that near samples, which matter most, stand for small areas. Out: offsets, pixels; areas,
// pixels.
#import "scene/sequence.wgsl"
#import "ssil/classes.wgsl"
#import "common/math.wgsl"
#import "common/random.wgsl"

struct Params {
    radius: f32,  // r, pixels of a level
    seed: u32,
    samples: u32,  // of each class in each shape
}

@group(1) @binding(11) var<storage, read_write> pattern: array<vec2u>;
@group(1) @binding(19) var<uniform> params: Params;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let per_shape = CLASSES * params.samples;
    if (id.x >= 2u * per_shape) {
        return;
    }
    let is_ring = id.x >= per_shape;
    let number = id.x % per_shape + sequence.index / CLASSES * per_shape;
    let u = sobol_2d(number, params.seed ^ select(0u, RING_SEED, is_ring));
    let r = params.radius;
    let radius = r * select(u.x, sqrt(0.25 + 0.75 * u.x), is_ring);
    let area = PI * r * select(2.0 * radius, 0.75 * r, is_ring) / f32(params.samples);
    let offset = vec2i(round(radius * vec2f(cos(TWO_PI * u.y), sin(TWO_PI * u.y))));
    pattern[id.x] = vec2u((u32(offset.x) & 0xffffu) | (u32(offset.y) << 16u), bitcast<u32>(area));
}
