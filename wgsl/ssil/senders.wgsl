// One invocation chooses the surfel that sends the light of a pixel of a level, among its four finer pixels.
//
// Pixel j is chosen with the probability Phi_j / sum_i Phi_i, Phi the brightest channel of its light: the mean over
// frames of the light that a receiver gets is the sum over the four. Departure: Soler et al. 2010 choose by the vote of
// eq. 5; the light of a sunlit ledge then comes from the wall beside it. In: senders and light of the finer level. Out:
// senders; their areas are summed over pixels that send light. Errs where colours differ: one channel chooses for all.
#import "ssil/surfel.wgsl"
#import "common/light_code.wgsl"
#import "scene/sequence.wgsl"
#import "common/random.wgsl"

@group(1) @binding(11) var finer: texture_storage_2d<rgba32uint, read>;
@group(1) @binding(12) var senders: texture_storage_2d<rgba32uint, write>;
@group(1) @binding(13) var<storage, read> light: array<vec2u>;
@group(1) @binding(19) var<uniform> params: Params;

struct Params {
    seed: u32,    // of this level
    offset: u32,  // the finer level's first entry in `light`
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (any(id.xy >= textureDimensions(senders))) {
        return;
    }
    let size = textureDimensions(finer);
    let facing = facing_side();
    let chance = hash2(id.x | (id.y << 16u), hash2(hash2(params.seed, sequence.ahead), sequence.index));
    var best = vec4u(0u);
    var sum = 0.0;
    var area = 0.0;
    for (var k = 0u; k < 4u; k += 1u) {
        let pixel = 2u * id.xy + vec2u(k & 1u, k >> 1u);
        if (any(pixel >= size)) {
            continue;
        }
        let sent = max3(unpack_light(light[params.offset + pixel.y * size.x + pixel.x]));
        let texel = textureLoad(finer, pixel);
        if (sent <= 0.0 || is_empty(texel)) {
            continue;
        }
        sum += sent;
        area += surfel_area(texel, facing);
        if (unit_float(hash(chance + k)) * sum < sent) {
            best = texel;
        }
    }
    if (sum > 0.0) {
        best = pack_surfel(Surfel(surfel_position(best), surfel_normal(best), area), facing);
    }
    textureStore(senders, id.xy, best);
}
