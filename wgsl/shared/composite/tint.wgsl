// One invocation multiplies a pixel's layers by its tint, after all filters. In and out: W/(m2 sr). The fourth value of
// `emission` is the share of the environment, which glass in front of it covers.
#import "common/math.wgsl"

struct Params {
    size: vec2u,  // pixels
}

@group(1) @binding(10) var<storage, read> tint: array<vec4f>;
@group(1) @binding(11) var<storage, read> emission: array<vec4f>;
@group(1) @binding(12) var<storage, read> direct: array<vec4f>;
@group(1) @binding(13) var<storage, read> indirect: array<vec4f>;
@group(1) @binding(14) var<storage, read_write> tinted_emission: array<vec4f>;
@group(1) @binding(15) var<storage, read_write> tinted_direct: array<vec4f>;
@group(1) @binding(16) var<storage, read_write> tinted_indirect: array<vec4f>;
@group(1) @binding(19) var<uniform> params: Params;

override HAS_INDIRECT: bool = true;

@compute @workgroup_size(64, 4)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (any(id.xy >= params.size)) {
        return;
    }
    let index = id.y * params.size.x + id.x;
    let factor = tint[index].rgb;
    let emitted = emission[index];
    tinted_emission[index] = vec4f(emitted.rgb * factor, emitted.a * luminance(factor));
    tinted_direct[index] = vec4f(direct[index].rgb * factor, direct[index].a);
    if (HAS_INDIRECT) {
        tinted_indirect[index] = vec4f(indirect[index].rgb * factor, indirect[index].a);
    }
}
