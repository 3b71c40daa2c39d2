// One invocation computes the light that 2x2 pixels of the first level send, its workgroup that of coarser levels,
// where each frame adds one bounce to the previous frame's light. Phi = Phi_direct + E_previous sum_j rho_j / pi ds_j.
//
// Reprojects by the motion vector of one pixel of the square, a different one each frame. Previous pixels at another
// distance get a small weight instead of 0: where all are rejected, wrong light is better than none. E_previous is at
// most that of a hemisphere of the brightest light, so that a feedback above 1 stays finite; light that leaks through
// walls without visibility can cause it. In: codes of `common/light_code.wgsl`, surfels, motion, previous irradiance,
// W/m2, with the distance, m, in w. Out: codes, W/sr, and the brightest radiance, W/(m2 sr). Lags by a frame per bounce
// where light or the view changes.
#import "scene/sequence.wgsl"
#import "ssil/surfel.wgsl"
#import "ssil/light_levels.wgsl"
#import "ssil/peak.wgsl"

override SQUARE: u32 = 2u;  // picture pixels per side of a pixel of the first level

@group(1) @binding(11) var<storage, read> reflectors: array<vec2u>;
@group(1) @binding(14) var<storage, read> sent: array<vec2u>;
@group(1) @binding(15) var<storage, read> motion: array<vec4f>;
@group(1) @binding(16) var<storage, read> previous: array<vec4f>;
@group(1) @binding(17) var<storage, read> previous_peak: array<u32>;
@group(1) @binding(18) var surfels: texture_storage_2d<rgba32uint, read>;
@group(1) @binding(31) var distance: texture_2d<f32>;

// A previous pixel shows another surface if its distance differs by more than this share. tools/README.md, "Constants".
const SAME_DISTANCE: f32 = 0.02;
// Weight of another surface: below the least bilinear weight that counts, far above the smallest float.
const OTHER_SURFACE_WEIGHT: f32 = 1e-4;
// Added to the bilinear weights of 3x3 pixels, so that pixels outside the bilinear four can replace rejected ones.
const AROUND_WEIGHT: f32 = 0.01;
// Irradiance over the brightest radiance: pi for a hemisphere, minus the 6 % by which surfels round their areas.
const HEMISPHERE: f32 = 3.0;

// Returns the previous frame's irradiance at the surface of a pixel.
fn previous_irradiance(pixel: vec2u, texel: vec4u, size: vec2u) -> vec3f {
    let subpixel = vec2u(sequence.index, sequence.index / SQUARE) % SQUARE;
    let fine = min(pixel * SQUARE + subpixel, view.size - 1u);
    let moved = motion[fine.y * view.size.x + fine.x];
    let place = vec2f(pixel) - moved.xy / f32(SQUARE);
    let nearest = vec2i(round(clamp(place, vec2f(-1.0), vec2f(size))));
    let expected_distance = length(surfel_position(texel)) + moved.z - textureLoad(distance, fine, 0).r;
    var sum = vec3f(0.0);
    var weights = 0.0;
    for (var k = 0; k < 9; k += 1) {
        let tap = nearest + vec2i(k % 3, k / 3) - 1;
        let bilinear = max(1.0 - abs(vec2f(tap) - place), vec2f(0.0));
        let inside = clamp(tap, vec2i(0), vec2i(size) - 1);
        let found = previous[u32(inside.y) * size.x + u32(inside.x)];
        let is_same = abs(found.w - expected_distance) <= SAME_DISTANCE * expected_distance;
        let similar = select(OTHER_SURFACE_WEIGHT, 1.0, is_same);
        let weight = select(0.0, (bilinear.x * bilinear.y + AROUND_WEIGHT) * similar, found.w > 0.0);
        sum += weight * found.rgb;
        weights += weight;
    }
    let most = vec3f(HEMISPHERE * bitcast<f32>(previous_peak[0]));
    return select(vec3f(0.0), min(sum / max(weights, 1e-30), most), weights > 0.0 && moved.w > 0.0);
}

@compute @workgroup_size(TILE_THREADS, TILE_THREADS)
fn main(
    @builtin(global_invocation_id) id: vec3u, @builtin(local_invocation_id) local: vec3u,
    @builtin(workgroup_id) group: vec3u,
) {
    let size = textureDimensions(surfels);
    let facing = facing_side();
    var sum = vec3f(0.0);
    var brightest = 0.0;
    for (var k = 0u; k < 4u; k += 1u) {
        let pixel = thread_pixel(id.xy, k);
        if (any(pixel >= size)) {
            continue;
        }
        let index = pixel.y * size.x + pixel.x;
        let texel = textureLoad(surfels, pixel);
        var value = unpack_light(sent[index]);
        if (!is_empty(texel)) {
            value += previous_irradiance(pixel, texel, size) * unpack_light(reflectors[index]);
            brightest = max(brightest, max3(value) / max(surfel_area(texel, facing), 1e-37));
        }
        sum += store_light(pixel, size, value);
    }
    store_coarser(group.xy, local.xy, size, sum);
    raise_peak(brightest);
}
