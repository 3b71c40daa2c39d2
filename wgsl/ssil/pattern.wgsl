// One invocation places one sample of a pattern: its offset from the pixel, and the area it represents.
//
// The first level samples the disc of radius r, the others the ring from r/2 to r (section 4). The 16 patterns together
// form one Sobol sequence. Departure: in the disc the radius, not its square, is uniform, so that near samples, which
// matter most, represent small areas. Out: offsets, pixels of the level, 16 bits each; areas, pixels.
#import "scene/sequence.wgsl"
#import "ssil/interleaving.wgsl"
#import "common/math.wgsl"
#import "common/random.wgsl"

struct Params {
    radius: f32,  // r, pixels of a level
    seed: u32,
    samples: u32,  // of a pattern in each shape
}

@group(1) @binding(11) var<storage, read_write> pattern: array<vec2u>;
@group(1) @binding(19) var<uniform> params: Params;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let per_shape = PATTERNS * params.samples;
    if (id.x >= 2u * per_shape) {
        return;
    }
    let is_ring = id.x >= per_shape;
    let number = id.x % per_shape + sequence.index / PATTERNS * per_shape;
    let u = sobol_2d(number, params.seed ^ select(0u, RING_SEED, is_ring));
    let r = params.radius;
    let radius = r * select(u.x, sqrt(0.25 + 0.75 * u.x), is_ring);
    let area = PI * r * select(2.0 * radius, 0.75 * r, is_ring) / f32(params.samples);
    let offset = vec2i(round(radius * vec2f(cos(TWO_PI * u.y), sin(TWO_PI * u.y))));
    pattern[id.x] = vec2u((u32(offset.x) & 0xffffu) | (u32(offset.y) << 16u), bitcast<u32>(area));
}
