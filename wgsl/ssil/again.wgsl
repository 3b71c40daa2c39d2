// One invocation finds the light that a pixel of the first level sends where bounces go round from frame to frame: of
// direct light, and of what it got in the frame before. Phi = Phi_direct + E_before * sum rho / pi ds.
//
// Where its surface was then says the motion of one of its pixels, in each frame another. Of the four pixels there,
// those at another distance hardly count, but are better than nothing. No pixel can have got more than all of a
// hemisphere of the brightest light there was: so light that passes through walls, for want of visibility, does not
// grow without end. In: codes of `common/light_code.wgsl`, surfels, motion, irradiance W/m2 and distance of the frame
// before. Out: codes, and the brightest radiance as bits of a float. Errs late where light or the view changes, by a
// frame for each bounce.
#import "scene/sequence.wgsl"
#import "ssil/surfel.wgsl"
#import "common/light_code.wgsl"

override SQUARE: u32 = 2u;  // pixels of the picture along the side of one of the first level

@group(1) @binding(11) var<storage, read> reflectors: array<vec2u>;
@group(1) @binding(12) var<storage, read> sent: array<vec2u>;
@group(1) @binding(13) var<storage, read> motion: array<vec4f>;
@group(1) @binding(14) var<storage, read> before: array<vec4f>;
@group(1) @binding(15) var<storage, read> peak_before: array<u32>;
@group(1) @binding(31) var distance: texture_2d<f32>;
@group(1) @binding(16) var surfels: texture_storage_2d<rgba32uint, read>;
@group(1) @binding(17) var<storage, read_write> light: array<vec2u>;
@group(1) @binding(18) var<storage, read_write> peak: array<atomic<u32>>;

// Another surface, if its distance differs by this share of it. Chosen.
const SAME_DISTANCE: f32 = 0.02;
// Weights of another surface, and of pixels further off than the four about the place. Chosen.
const LEAST: f32 = 1e-4;
const AROUND: f32 = 0.01;
const HEMISPHERE: f32 = 3.0;  // pi, less what surfels round off their areas

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(surfels);
    if (any(id.xy >= size)) {
        return;
    }
    let index = id.y * size.x + id.x;
    let texel = textureLoad(surfels, id.xy);
    if (is_empty(texel)) {
        light[index] = sent[index];
        return;
    }
    let asked = vec2u(sequence.index, sequence.index / SQUARE) % SQUARE;
    let pixel = min(id.xy * SQUARE + asked, view.size - 1u);
    let moved = motion[pixel.y * view.size.x + pixel.x];
    let place = vec2f(id.xy) - moved.xy / f32(SQUARE);
    let nearest = vec2i(round(clamp(place, vec2f(-1.0), vec2f(size))));
    let then = length(surfel_position(texel)) + moved.z - textureLoad(distance, pixel, 0).r;
    var got = vec3f(0.0);
    var weights = 0.0;
    for (var k = 0; k < 9; k += 1) {
        let at = nearest + vec2i(k % 3, k / 3) - 1;
        let share = max(1.0 - abs(vec2f(at) - place), vec2f(0.0));
        let inside = clamp(at, vec2i(0), vec2i(size) - 1);
        let found = before[u32(inside.y) * size.x + u32(inside.x)];
        let same = select(LEAST, 1.0, abs(found.w - then) <= SAME_DISTANCE * then);
        let weight = select(0.0, (share.x * share.y + AROUND) * same, found.w > 0.0);
        got += weight * found.rgb;
        weights += weight;
    }
    let most = HEMISPHERE * bitcast<f32>(peak_before[0]);
    let irradiance = select(vec3f(0.0), min(got / max(weights, 1e-30), vec3f(most)), weights > 0.0 && moved.w > 0.0);
    let all = unpack_light(sent[index]) + irradiance * unpack_light(reflectors[index]);
    light[index] = pack_light(all);
    let bits = bitcast<u32>(max3(all) / max(surfel_area(texel, facing_side()), 1e-37));
    // Reading first is cheaper where it is not the largest, which is the rule.
    if (bits > atomicLoad(&peak[0])) {
        atomicMax(&peak[0], bits);
    }
}
