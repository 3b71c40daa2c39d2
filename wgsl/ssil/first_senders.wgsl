// One invocation chooses the surfel that sends the direct light of a pixel of the first level, among its pixels of the
// picture, in proportion to the light that each sends: as `ssil/senders.wgsl`.
//
// In: G-buffer, direct light, W/(m2 sr); surfels of the picture. Out: senders; where no pixel sends light, any of them,
// for light of further bounces. Errs where colours differ: one channel chooses for all.
#import "shared/gbuffer/load.wgsl"
#import "ssil/surfel.wgsl"
#import "scene/sequence.wgsl"
#import "common/matte.wgsl"
#import "common/random.wgsl"

override SQUARE: u32 = 2u;     // picture pixels per side of a pixel of the first level
override SPLIT: bool = false;  // shiny surfaces send no light

@group(1) @binding(11) var pixels: texture_storage_2d<rgba32uint, read>;
@group(1) @binding(12) var senders: texture_storage_2d<rgba32uint, write>;
@group(1) @binding(13) var<storage, read> direct: array<vec4f>;
@group(1) @binding(19) var<uniform> params: Params;

struct Params {
    seed: u32,
}

// Weight of area beside light, W/(m2 sr): far below any light that matters, above the least normal float.
const UNLIT_WEIGHT: f32 = 1e-30;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (any(id.xy >= textureDimensions(senders))) {
        return;
    }
    let facing = facing_side();
    let chance = hash2(id.x | (id.y << 16u), hash2(hash2(params.seed, sequence.ahead), sequence.index));
    var best = vec4u(0u);
    var sum = 0.0;
    var lit_area = 0.0;
    for (var k = 0u; k < SQUARE * SQUARE; k += 1u) {
        let pixel = SQUARE * id.xy + vec2u(k % SQUARE, k / SQUARE);
        if (any(pixel >= view.size)) {
            continue;
        }
        let texel = textureLoad(pixels, pixel);
        if (is_empty(texel)) {
            continue;
        }
        var radiance = max3(direct[pixel.y * view.size.x + pixel.x].rgb);
        if (SPLIT && !is_matte_brdf(gbuffer_brdf(load_surface(pixel)))) {
            radiance = 0.0;
        }
        let area = surfel_area(texel, facing);
        let weight = max(radiance, UNLIT_WEIGHT) * area;
        sum += weight;
        lit_area += select(0.0, area, radiance > 0.0);
        if (unit_float(hash(chance + k)) * sum < weight) {
            best = texel;
        }
    }
    if (!is_empty(best)) {
        let area = select(surfel_area(best, facing), lit_area, lit_area > 0.0);
        best = pack_surfel(Surfel(surfel_position(best), surfel_normal(best), area), facing);
    }
    textureStore(senders, id.xy, best);
}
