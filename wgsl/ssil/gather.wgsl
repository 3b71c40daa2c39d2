// The irradiance that a pixel gets from samples of its pattern at one level. Who imports this defines
// fn prepare(start: Place), which is called once, and fn visibility(start: Place, end: Place, number: u32) -> f32, from
// 0 to 1.
//
// E = sum_i Phi_i cos_i cos'_i V_i / (d_i^2 + R_i^2), R_i^2 = cos'_i A_i / pi: eq. 3 with the point-to-disc form factor
// of eq. 4, which lacks a factor of pi there (both are the same for small areas only with it). Phi_i is the light of
// the sample's pixel times the number of pixels that it stands for, A_i likewise. In: surfels and light of the level,
// the pattern, surfels of those who receive. Out: irradiance, W/m2. Errs dark in corners, where a disc that faces the
// receiver is not what is there.
#import "scene/sequence.wgsl"
#import "ssil/surfel.wgsl"
#import "ssil/classes.wgsl"
#import "ssil/place.wgsl"
#import "common/light_code.wgsl"
#import "shared/upsample/unrepresented.wgsl"

struct Params {
    grid_size: vec2u,  // of the voxels, if any: cells,
    cell: f32,         // pixels of the picture along the side of a cell,
    step: f32,         // and cells between two steps of a march
    light_offset: u32, // where the level begins in `light`
    shift: u32,        // level of the samples above that of the receivers
    parts: u32,        // of the pattern: a receiver takes one in a frame
    first: u32,        // class of the pattern that is the first of the shape, disc or ring
}

override BOUNDED: bool = true;  // by the disc, else the plain form factor of eq. 1
// Of the sample's area: a whole disc, exact only straight above it, takes too much light from corners. 320x180, voxels,
// 16 frames, bias and relMSE with 1 and with 0.25: Cornell's spot -2.7, -0.7 % and 0.077, 0.082; point light -4.0,
// -0.5 % and 0.029, 0.029; area light -8.5, -4.1 % and 0.019, 0.017.
const BOUND_SHARE: f32 = 0.25;

@group(1) @binding(11) var surfels: texture_storage_2d<rgba32uint, read>;
@group(1) @binding(12) var<storage, read> light: array<vec2u>;
@group(1) @binding(13) var<storage, read> pattern: array<vec2u>;
@group(1) @binding(14) var<storage, read_write> irradiance: array<vec4f>;

@group(1) @binding(15) var<storage, read> peak: array<u32>;  // brightest light, and what counts as none; bits of floats

@group(1) @binding(19) var receivers: texture_2d<u32>;  // surfels of the pixels that gather
@group(1) @binding(21) var<uniform> params: Params;

// Returns the pixel that a sample of the pattern lies at.
fn place_of(start: Place, entry: vec2u) -> vec2i {
    return start.pixel + (vec2i(bitcast<i32>(entry.x << 16u), bitcast<i32>(entry.x)) >> vec2u(16u));
}

// Returns which of `count` samples of the pattern, from `first` on, send any light, a bit each.
fn lit_samples(start: Place, first: u32, count: u32, size: vec2u) -> u32 {
    var lit = 0u;
    for (var k = 0u; k < count; k += 1u) {
        let place = place_of(start, pattern[first + k]);
        let inside = all(place >= vec2i(0)) && all(place < vec2i(size));
        let code = light[params.light_offset + select(0u, u32(place.y) * size.x + u32(place.x), inside)];
        lit |= select(0u, 1u << k, inside && (code.x | (code.y & 0xffffu)) != 0u);
    }
    return lit;
}

// Returns which of the samples `lit` the pixel faces, and they it.
fn facing_samples(start: Place, first: u32, lit: u32) -> u32 {
    var left = lit;
    var facing = 0u;
    while (left != 0u) {
        let k = firstTrailingBit(left);
        left &= left - 1u;
        let texel = textureLoad(surfels, vec2u(place_of(start, pattern[first + k])));
        let way = surfel_position(texel) - start.position;
        let is_facing = max(dot(start.normal, way), 0.0) * max(-dot(surfel_normal(texel), way), 0.0) > 0.0;
        facing |= select(0u, 1u << k, is_facing);
    }
    return facing;
}

// Returns the irradiance by a sample that faces the pixel; `side` is facing_side().
fn received(start: Place, entry: vec2u, width: u32, side: vec4f, number: u32) -> vec3f {
    let place = place_of(start, entry);
    let texel = textureLoad(surfels, vec2u(place));
    let end = Place(place, surfel_position(texel), surfel_normal(texel));
    let way = end.position - start.position;
    let squared = dot(way, way);
    let arriving = max(dot(start.normal, way), 0.0);
    let leaving = max(-dot(end.normal, way), 0.0);
    let count = bitcast<f32>(entry.y);
    let disc = leaving * inverseSqrt(squared) * count * surfel_area(texel, side) * (BOUND_SHARE * INV_PI);
    // Both cosines still have a length of d.
    let term = count * arriving * leaving / max(squared * (squared + select(0.0, disc, BOUNDED)), 1e-37);
    return unpack_light(light[params.light_offset + u32(place.y) * width + u32(place.x)]) * (term * visibility(start, end, number));
}

// Returns the irradiance by `count` samples of the pattern from `first` on.
fn irradiance_by(start: Place, first: u32, count: u32) -> vec3f {
    let size = textureDimensions(surfels);
    let side = facing_side();
    var sum = vec3f(0.0);
    // Threads that run in step do what any of them needs, and lavapipe runs what none needs: what is cheap is asked of
    // all samples first, and each thread goes on with those of its own that are left.
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

// Returns what a pixel gets by a part of the samples of its class.
fn irradiance_at(pixel: vec2u, own: vec4u, part: u32) -> vec3f {
    let start = Place(vec2i(pixel >> vec2u(params.shift)), surfel_position(own), surfel_normal(own));
    prepare(start);
    let samples = arrayLength(&pattern) / (2u * CLASSES);
    let taken = max(samples / params.parts, 1u);
    let table = (params.first + pattern_of(pixel, sequence.index)) * samples;
    let first = table + part % (samples / taken) * taken;
    return irradiance_by(start, first, taken) * (f32(samples) / f32(taken));
}

fn gather(group: vec3u, thread: vec3u) {
    let size = textureDimensions(receivers);
    let first = vec2u(group.y % SIDE, group.y / SIDE % SIDE);
    let pixel = (vec2u(group.x, group.y / CLASSES) * 8u + thread.xy) * SIDE + first;
    if (any(pixel >= size)) {
        return;
    }
    let index = pixel.y * size.x + pixel.x;
    let own = textureLoad(receivers, pixel, 0);
    // Nothing to light, or nothing that lights.
    if (is_empty(own) || peak[0] <= peak[1]) {
        irradiance[index] = vec4f(0.0);
        return;
    }
    irradiance[index] = vec4f(irradiance_at(pixel, own, quarter_of(first, sequence.index)), 1.0);
}

// Adds to the irradiance of unrepresented pixels what they get from this level.
fn gather_unrepresented(thread: u32, threads: u32) {
    let count = select(unrepresented_count(), 0u, peak[0] <= peak[1]);
    for (var slot = thread; slot < count; slot += threads) {
        let index = unrepresented[slot];
        let pixel = vec2u(index % view.size.x, index / view.size.x);
        let part = pixel.x / SIDE + pixel.y / SIDE + sequence.index + (sequence.index >> 2u);  // not as patterns come
        let got = irradiance_at(pixel, textureLoad(receivers, pixel, 0), part);
        irradiance[slot] = vec4f(irradiance[slot].rgb + got, 1.0);
    }
}
