// The irradiance of a pixel from samples of one level. The importing shader defines fn prepare(start: Endpoint), called
// once per pixel, fn visibility(start: Endpoint, end: Endpoint, number: u32) -> vec3f, from 0 to 1, and DRAWS_PER_TEST, the
// number of drawn samples per test.
//
// E = sum_i Phi_i cos_i cos'_i V_i / (d_i^2 + R_i^2), R_i^2 = BOUND_SHARE cos'_i A_i / pi: eq. 3 with the point-to-disc
// form factor of eq. 4, times the factor of pi that eq. 4 lacks (without it, both form factors differ for small areas).
// Phi_i and A_i are the light and area of the sample's pixel times the number of pixels that it represents.
//
// Departure: resampling (Talbot et al. 2005, "Importance Resampling for Global Illumination"). Of each CANDIDATES
// neighbouring samples one is drawn with a probability in proportion to p_i, its unshadowed term's brightest channel;
// it counts sum(p) / p_i times. Of DRAWS_PER_TEST drawn samples one is drawn again and tested for visibility. The mean is
// that of all samples.
//
// In: surfels and light of the level, samples, surfels of the receivers. Out: irradiance, W/m2. Errs dark in corners,
// where the disc bounds more than the true form factor.
#import "scene/sequence.wgsl"
#import "ssil/surfel.wgsl"
#import "ssil/interleaving.wgsl"
#import "ssil/corner.wgsl"
#import "ssil/endpoint.wgsl"
#import "common/light_code.wgsl"
#import "common/random.wgsl"
#import "shared/upsample/unrepresented.wgsl"

struct Params {
    grid_size: vec2u,   // cells of the voxel grid, if any
    cell: f32,          // pixels of the picture along the side of a cell
    step: f32,          // of a march, cells
    light_offset: u32,  // the level's first entry in `light`
    level: u32,         // of the samples: pixels of the picture along the side of a pixel, as a power of two
    stride: u32,        // pixels of the picture from one receiver to the next
    first: u32,         // first pattern of the shape, disc or ring
    seed: u32,
}

const BATCH: u32 = 32u;  // candidates tested together

override BOUNDED: bool = true;  // true: point-to-disc form factor (bounded); false: differential area, eq. 1
// Share of the sample's area in the disc: the form factor of a whole disc is exact only on its axis and removes too
// much light from corners. tools/README.md, "Constants".
const BOUND_SHARE: f32 = 0.125;

@group(1) @binding(11) var surfels: texture_storage_2d<rgba32uint, read>;
@group(1) @binding(12) var<storage, read> light: array<vec2u>;
@group(1) @binding(13) var<storage, read> pattern: array<vec2u>;
@group(1) @binding(14) var<storage, read_write> irradiance: array<vec4f>;
@group(1) @binding(15) var<storage, read> peak: array<u32>;  // brightest light, and threshold of no light: float bits
@group(1) @binding(19) var receivers: texture_2d<u32>;  // surfels of the pixels that gather
@group(1) @binding(21) var<uniform> params: Params;

var<private> place: vec2f;  // of the receiver, pixels of the samples' level
var<private> turn: vec2f;   // cosine and sine of the pattern's rotation
var<private> chance: u32;   // random bits of the receiver

// Returns the pixel of a sample.
fn sample_pixel(entry: vec2u) -> vec2i {
    let offset = unpack2x16float(entry.x);
    return vec2i(floor(place + turn.x * offset + turn.y * vec2f(-offset.y, offset.x)));
}

// Returns the bits of those of `count` candidates, from `first` on, that send light: more than 2^-110 W/sr.
fn lit_samples(first: u32, count: u32, size: vec2u) -> u32 {
    var lit = 0u;
    for (var k = 0u; k < count; k += 1u) {
        let at = sample_pixel(pattern[first + k]);
        let inside = all(at >= vec2i(0)) && all(at < vec2i(size));
        let code = light[params.light_offset + select(0u, u32(at.y) * size.x + u32(at.x), inside)].y;
        lit |= select(0u, 1u << k, inside && (code & 0xff0000u) != 0u);
    }
    return lit;
}

// Returns the largest channel of the unshadowed irradiance from a candidate; `side`: facing_side().
fn unshadowed(start: Endpoint, entry: vec2u, width: u32, side: vec4f) -> f32 {
    let at = vec2u(sample_pixel(entry));
    let texel = textureLoad(surfels, at);
    let way = surfel_position(texel) - start.position;
    let squared = dot(way, way);
    // Cosines times d.
    let arriving = max(dot(start.normal, way), 0.0);
    let leaving = max(-dot(surfel_normal(texel), way), 0.0);
    let count = bitcast<f32>(entry.y);
    let disc = leaving * inverseSqrt(squared) * count * surfel_area(texel, side) * (BOUND_SHARE * INV_PI);
    let term = count * arriving * leaving / max(squared * (squared + select(0.0, disc, BOUNDED)), 1e-37);
    return max3(unpack_light(light[params.light_offset + at.y * width + at.x])) * term;
}

// The candidates drawn from BATCH of them, as bits, and the sum of each group's unshadowed irradiance.
struct Drawn {
    bits: u32,
    sums: array<f32, BATCH / CANDIDATES>,
}

// Draws one of each group's `lit` candidates, from `first` on, in proportion to its unshadowed irradiance.
fn draw(start: Endpoint, first: u32, lit: u32, width: u32, side: vec4f) -> Drawn {
    var drawn = Drawn();
    var left = lit;
    while (left != 0u) {
        let k = firstTrailingBit(left);
        left &= left - 1u;
        let light = unshadowed(start, pattern[first + k], width, side);
        let group = k / CANDIDATES;
        let sum = drawn.sums[group] + light;
        drawn.sums[group] = sum;
        if (unit_float(hash(chance + first + k)) * sum < light) {
            drawn.bits = (drawn.bits & ~(((1u << CANDIDATES) - 1u) << (group * CANDIDATES))) | (1u << k);
        }
    }
    return drawn;
}

// Returns the colour of a sample's light, its brightest channel 1, or 0 if it is hidden.
fn tested(start: Endpoint, at: vec2i, width: u32, number: u32) -> vec3f {
    let texel = textureLoad(surfels, vec2u(at));
    let end = Endpoint(at, surfel_position(texel), surfel_normal(texel));
    let colour = unpack_light(light[params.light_offset + u32(at.y) * width + u32(at.x)]);
    return colour * (visibility(start, end, number) / max3(colour));
}

// Returns the irradiance from `count` candidates, from `first` on.
fn irradiance_by(start: Endpoint, first: u32, count: u32) -> vec3f {
    let size = textureDimensions(surfels);
    let side = facing_side();
    var sum = vec3f(0.0);
    var total = 0.0;
    var draws = 0u;
    var kept = vec2i(0);
    var number = 0u;
    // Lanes run in lockstep, so a branch saves time only if all take it. Do the cheap tests for all candidates first;
    // then each lane loops over its own drawn ones.
    for (var k = 0u; k < count; k += BATCH) {
        let lit = lit_samples(first + k, min(count - k, BATCH), size);
        var drawn = draw(start, first + k, lit, size.x, side);
        while (drawn.bits != 0u) {
            let bit = firstTrailingBit(drawn.bits);
            drawn.bits &= drawn.bits - 1u;
            let at = sample_pixel(pattern[first + k + bit]);
            let group = bit / CANDIDATES;
            // Draw again, one of each DRAWS_PER_TEST: it stands for all of them.
            let sent = drawn.sums[group];
            total += sent;
            if (unit_float(hash(chance ^ (first + k + bit))) * total < sent) {
                kept = at;
                number = k / CANDIDATES + group;
            }
            draws += 1u;
            if (draws == DRAWS_PER_TEST || (drawn.bits == 0u && k + BATCH >= count)) {
                sum += tested(start, kept, size.x, number) * total;
                total = 0.0;
                draws = 0u;
            }
        }
    }
    // Draws left over from a batch without an end of its own.
    if (draws > 0u) {
        sum += tested(start, kept, size.x, number) * total;
    }
    return sum;
}

// Returns the irradiance of a pixel from its pattern.
fn irradiance_at(pixel: vec2u, own: vec4u) -> vec3f {
    let fine = params.stride * pixel + receiver_place(sequence.index, params.stride);
    place = (vec2f(fine) + 0.5) / f32(1u << params.level);
    // Blocks rotate their patterns apart; a block keeps its rotation until it has used all patterns.
    let seed = hash2(params.seed, sequence.ahead);
    let block = pixel / INTERLEAVE;
    let angle = hash2(block.x | (block.y << 16u), hash2(seed, sequence.index / PATTERNS));
    turn = vec2f(cos(TWO_PI * unit_float(angle)), sin(TWO_PI * unit_float(angle)));
    chance = hash2(pixel.x | (pixel.y << 16u), hash2(seed ^ params.level, sequence.index));
    let start = Endpoint(vec2i(floor(place)), surfel_position(own), surfel_normal(own));
    prepare(start);
    let samples = arrayLength(&pattern) / (2u * PATTERNS);
    return irradiance_by(start, (params.first + pattern_of(pixel, sequence.index)) * samples, samples);
}

// Adds this level's irradiance to that of a pixel.
fn gather(group: vec3u, thread: vec3u) {
    let size = textureDimensions(receivers);
    let first = vec2u(group.y % INTERLEAVE, group.y / INTERLEAVE % INTERLEAVE);
    let pixel = (vec2u(group.x, group.y / PATTERNS) * 8u + thread.xy) * INTERLEAVE + first;
    if (any(pixel >= size)) {
        return;
    }
    let index = pixel.y * size.x + pixel.x;
    let own = textureLoad(receivers, pixel, 0);
    // Skip pixels without a surface, and bounces without light above the threshold.
    if (is_empty(own) || peak[0] <= peak[1]) {
        return;
    }
    irradiance[index] = vec4f(irradiance[index].rgb + irradiance_at(pixel, own), 1.0);
}

// Adds this level's irradiance to that of unrepresented pixels; theirs is an entry per pixel of the picture.
fn gather_unrepresented(thread: u32, threads: u32) {
    let count = select(unrepresented_count(), 0u, peak[0] <= peak[1]);
    for (var slot = thread; slot < count; slot += threads) {
        let index = unrepresented[slot];
        let pixel = vec2u(index % view.size.x, index / view.size.x);
        let got = irradiance_at(pixel, textureLoad(receivers, pixel, 0));
        irradiance[index] = vec4f(irradiance[index].rgb + got, 1.0);
    }
}
