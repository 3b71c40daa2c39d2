// The irradiance that a pixel of a level gets from the samples of its pattern. Who imports this defines
// fn prepare(start: Place), which is called once, and fn visibility(start: Place, end: Place, number: u32) -> f32, from
// 0 to 1.
//
// E = sum_i Phi_i cos_i cos'_i V_i / (d_i^2 + R_i^2), R_i^2 = cos'_i A_i / pi: eq. 3 with the point-to-disc form factor
// of eq. 4, which lacks a factor of pi there (both are the same for small areas only with it). Phi_i is the light of
// the sample's pixel times the number of pixels that it stands for, A_i likewise. In: surfels and light of the level,
// the pattern. Out: irradiance, W/m2. Errs dark in corners, where a disc that faces the receiver is not what is there.
#import "scene/sequence.wgsl"
#import "ssil/surfel.wgsl"
#import "ssil/classes.wgsl"
#import "ssil/place.wgsl"
#import "common/light_code.wgsl"

override FINEST: bool = true;    // the disc, else the ring
override BOUNDED: bool = true;   // by the disc, else the plain form factor of eq. 1
// Of the sample's area: a whole disc, exact only straight above it, takes too much light from corners. 320x180, voxels,
// 16 frames, bias and relMSE with 1 and with 0.25: Cornell's spot -2.7, -0.7 % and 0.077, 0.082; point light -4.0,
// -0.5 % and 0.029, 0.029; area light -8.5, -4.1 % and 0.019, 0.017.
override BOUND_SHARE: f32 = 0.25;
override LEAST_LIGHT: f32 = 0.0; // of the brightest light of the first bounce: where none is above it, none is gathered

@group(1) @binding(11) var surfels: texture_storage_2d<rgba32uint, read>;
@group(1) @binding(12) var<storage, read> light: array<vec2u>;
@group(1) @binding(13) var<storage, read> pattern: array<vec2u>;
@group(1) @binding(14) var<storage, read_write> irradiance: array<vec4f>;

@group(1) @binding(15) var<storage, read> peak: array<u32>;        // brightest light of the bounce, bits of a float
@group(1) @binding(16) var<storage, read> first_peak: array<u32>;  // and of the first one

fn gather(group: vec3u, thread: vec3u) {
    let size = textureDimensions(surfels);
    let first = vec2u(group.y % SIDE, group.y / SIDE % SIDE);
    let pixel = (vec2u(group.x, group.y / CLASSES) * 8u + thread.xy) * SIDE + first;
    if (any(pixel >= size)) {
        return;
    }
    let index = pixel.y * size.x + pixel.x;
    let own = textureLoad(surfels, pixel);
    // Nothing to light, or nothing that lights.
    let brightest = bitcast<f32>(peak[0]);
    if (is_empty(own) || brightest <= LEAST_LIGHT * bitcast<f32>(first_peak[0])) {
        irradiance[index] = vec4f(0.0);
        return;
    }
    let normal = surfel_normal(own);
    let start = Place(vec2i(pixel), surfel_position(own), normal);
    prepare(start);
    let table = (select(CLASSES, 0u, FINEST) + pattern_of(first, sequence.index)) * SAMPLES;
    var sum = vec3f(0.0);
    for (var k = 0u; k < SAMPLES; k += 1u) {
        let entry = pattern[table + k];
        let offset = vec2i(bitcast<i32>(entry.x << 16u), bitcast<i32>(entry.x)) >> vec2u(16u);
        let place = start.pixel + offset;
        let inside = all(place >= vec2i(0)) && all(place < vec2i(size));
        let code = light[select(0, place.y * i32(size.x) + place.x, inside)];
        if (!inside || (code.x | (code.y & 0xffffu)) == 0u) {
            continue;
        }
        let texel = textureLoad(surfels, vec2u(place));
        let end = Place(place, surfel_position(texel), surfel_normal(texel));
        let way = end.position - start.position;
        let squared = dot(way, way);
        let arriving = max(dot(normal, way), 0.0);
        let leaving = max(-dot(end.normal, way), 0.0);
        if (arriving * leaving <= 0.0) {
            continue;
        }
        let count = bitcast<f32>(entry.y);
        let disc = leaving * inverseSqrt(squared) * count * surfel_area(texel) * (BOUND_SHARE * INV_PI);
        // Both cosines still have a length of d.
        let term = count * arriving * leaving / max(squared * (squared + select(0.0, disc, BOUNDED)), 1e-37);
        sum += unpack_light(code) * (term * visibility(start, end, k));
    }
    irradiance[index] = vec4f(sum, 1.0);
}
