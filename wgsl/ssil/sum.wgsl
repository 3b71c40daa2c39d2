// One invocation adds up the light of four pixels of the finer level. In, out: codes of `common/light_code.wgsl`.
#import "common/light_code.wgsl"

struct Params {
    finer_size: vec2u,  // pixels
    size: vec2u,
}

@group(1) @binding(11) var<storage, read> finer: array<vec2u>;
@group(1) @binding(12) var<storage, read_write> light: array<vec2u>;
@group(1) @binding(19) var<uniform> params: Params;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (any(id.xy >= params.size)) {
        return;
    }
    var sum = vec3f(0.0);
    for (var k = 0u; k < 4u; k += 1u) {
        let pixel = 2u * id.xy + vec2u(k & 1u, k >> 1u);
        let inside = all(pixel < params.finer_size);
        let found = unpack_light(finer[select(0u, pixel.y * params.finer_size.x + pixel.x, inside)]);
        sum += select(vec3f(0.0), found, inside);
    }
    light[id.y * params.size.x + id.x] = pack_light(sum);
}
