// The irradiance of a pixel from samples of one level. The importing shader defines fn prepare(start: Endpoint), called
// once per pixel, and fn visibility(start: Endpoint, end: Endpoint, number: u32) -> f32, from 0 to 1.
//
// E = sum_i Phi_i cos_i cos'_i V_i / (d_i^2 + R_i^2), R_i^2 = BOUND_SHARE cos'_i A_i / pi: eq. 3 with the point-to-disc
// form factor of eq. 4, times the factor of pi that eq. 4 lacks (without it, both form factors differ for small areas).
// Phi_i and A_i are the light and area of the sample's pixel times the number of pixels that it represents. In: surfels
// and light of the level, samples, surfels of the receivers. Out: irradiance, W/m2. Errs dark in corners, where the
// disc bounds more than the true form factor.
#import "scene/sequence.wgsl"
#import "ssil/surfel.wgsl"
#import "ssil/interleaving.wgsl"
#import "ssil/endpoint.wgsl"
#import "common/light_code.wgsl"
#import "shared/upsample/unrepresented.wgsl"

struct Params {
    grid_size: vec2u,   // cells of the voxel grid, if any
    cell: f32,          // pixels of the picture along the side of a cell
    step: f32,          // of a march, cells
    light_offset: u32,  // the level's first entry in `light`
    shift: u32,         // levels from the receivers up to the samples
    parts: u32,         // of a pattern; a receiver uses one part per frame
    first: u32,         // first pattern of the shape, disc or ring
}

override BOUNDED: bool = true;  // true: point-to-disc form factor (bounded); false: differential area, eq. 1
// Share of the sample's area in the disc: the form factor of a whole disc is exact only on its axis and removes too
// much light from corners. 320x180, voxels, 16 frames, bias and relMSE with 1 and with 0.25: Cornell's spot -2.7, -0.7
// % and 0.077, 0.082; point light -4.0, -0.5 % and 0.029, 0.029; area light -8.5, -4.1 % and 0.019, 0.017.
const BOUND_SHARE: f32 = 0.25;

@group(1) @binding(11) var surfels: texture_storage_2d<rgba32uint, read>;
@group(1) @binding(12) var<storage, read> light: array<vec2u>;
@group(1) @binding(13) var<storage, read> pattern: array<vec2u>;
@group(1) @binding(14) var<storage, read_write> irradiance: array<vec4f>;
@group(1) @binding(15) var<storage, read> peak: array<u32>;  // brightest light, and threshold of no light: float bits
@group(1) @binding(19) var receivers: texture_2d<u32>;  // surfels of the pixels that gather
@group(1) @binding(21) var<uniform> params: Params;

// Returns the pixel of a sample.
fn sample_pixel(start: Endpoint, entry: vec2u) -> vec2i {
    return start.pixel + (vec2i(bitcast<i32>(entry.x << 16u), bitcast<i32>(entry.x)) >> vec2u(16u));
}

// Returns the bits of those of `count` samples of the pattern, from `first` on, that send light.
fn lit_samples(start: Endpoint, first: u32, count: u32, size: vec2u) -> u32 {
    var lit = 0u;
    for (var k = 0u; k < count; k += 1u) {
        let place = sample_pixel(start, pattern[first + k]);
        let inside = all(place >= vec2i(0)) && all(place < vec2i(size));
        let code = light[params.light_offset + select(0u, u32(place.y) * size.x + u32(place.x), inside)];
        lit |= select(0u, 1u << k, inside && (code.x | (code.y & 0xffffu)) != 0u);
    }
    return lit;
}

// Returns the bits of the `lit` samples that face the pixel and that the pixel faces.
fn facing_samples(start: Endpoint, first: u32, lit: u32) -> u32 {
    var left = lit;
    var facing = 0u;
    while (left != 0u) {
        let k = firstTrailingBit(left);
        left &= left - 1u;
        let texel = textureLoad(surfels, vec2u(sample_pixel(start, pattern[first + k])));
        let way = surfel_position(texel) - start.position;
        let is_facing = max(dot(start.normal, way), 0.0) * max(-dot(surfel_normal(texel), way), 0.0) > 0.0;
        facing |= select(0u, 1u << k, is_facing);
    }
    return facing;
}

// Returns the irradiance from a facing sample; `side`: facing_side().
fn received(start: Endpoint, entry: vec2u, width: u32, side: vec4f, number: u32) -> vec3f {
    let place = sample_pixel(start, entry);
    let texel = textureLoad(surfels, vec2u(place));
    let end = Endpoint(place, surfel_position(texel), surfel_normal(texel));
    let way = end.position - start.position;
    let squared = dot(way, way);
    let arriving = max(dot(start.normal, way), 0.0);
    let leaving = max(-dot(end.normal, way), 0.0);
    let count = bitcast<f32>(entry.y);
    let disc = leaving * inverseSqrt(squared) * count * surfel_area(texel, side) * (BOUND_SHARE * INV_PI);
    // `arriving` and `leaving` are cosines times d.
    let term = count * arriving * leaving / max(squared * (squared + select(0.0, disc, BOUNDED)), 1e-37);
    let code = light[params.light_offset + u32(place.y) * width + u32(place.x)];
    return unpack_light(code) * (term * visibility(start, end, number));
}

// Returns the irradiance from `count` samples of the pattern, from `first` on.
fn irradiance_by(start: Endpoint, first: u32, count: u32) -> vec3f {
    let size = textureDimensions(surfels);
    let side = facing_side();
    var sum = vec3f(0.0);
    // Lanes run in lockstep, so a branch saves time only if all take it. Do the cheap tests for all samples first; then
    // each lane loops over its own remaining samples.
    for (var k = 0u; k < count; k += 32u) {
        let lit = lit_samples(start, first + k, min(count - k, 32u), size);
        var left = facing_samples(start, first + k, lit);
        while (left != 0u) {
            let number = k + firstTrailingBit(left);
            left &= left - 1u;
            sum += received(start, pattern[first + number], size.x, side, number);
        }
    }
    return sum;
}

// Returns the irradiance of a pixel from one part of its pattern.
fn irradiance_at(pixel: vec2u, own: vec4u, part: u32) -> vec3f {
    let start = Endpoint(vec2i(pixel >> vec2u(params.shift)), surfel_position(own), surfel_normal(own));
    prepare(start);
    let samples = arrayLength(&pattern) / (2u * PATTERNS);
    let taken = max(samples / params.parts, 1u);
    let table = (params.first + pattern_of(pixel, sequence.index)) * samples;
    let first = table + part % (samples / taken) * taken;
    return irradiance_by(start, first, taken) * (f32(samples) / f32(taken));
}

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
        irradiance[index] = vec4f(0.0);
        return;
    }
    irradiance[index] = vec4f(irradiance_at(pixel, own, quarter_of(first, sequence.index)), 1.0);
}

// Adds this level's irradiance to that of unrepresented pixels.
fn gather_unrepresented(thread: u32, threads: u32) {
    let count = select(unrepresented_count(), 0u, peak[0] <= peak[1]);
    for (var slot = thread; slot < count; slot += threads) {
        let index = unrepresented[slot];
        let pixel = vec2u(index % view.size.x, index / view.size.x);
        // The part changes from block to block and from frame to frame; every four frames its order shifts against the
        // pattern's.
        let block = pixel / INTERLEAVE;
        let part = block.x + block.y + sequence.index + (sequence.index >> 2u);
        let got = irradiance_at(pixel, textureLoad(receivers, pixel, 0), part);
        irradiance[slot] = vec4f(irradiance[slot].rgb + got, 1.0);
    }
}
