// One invocation sums the layers of a pixel: radiance = emission + direct + indirect. In and out: W/(m2 sr). The fourth
// value of `radiance` is the coverage: 1 if the pixel shows a surface, else 0; that of `emission` is 1 minus it.

struct Params {
    size: vec2u,  // pixels
}

@group(1) @binding(11) var<storage, read> emission: array<vec4f>;
@group(1) @binding(12) var<storage, read> direct: array<vec4f>;
@group(1) @binding(13) var<storage, read> indirect: array<vec4f>;
@group(1) @binding(14) var<storage, read_write> radiance: array<vec4f>;
@group(1) @binding(19) var<uniform> params: Params;

override HAS_INDIRECT: bool = true;

@compute @workgroup_size(64, 4)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (any(id.xy >= params.size)) {
        return;
    }
    let index = id.y * params.size.x + id.x;
    var sum = emission[index].rgb + direct[index].rgb;
    if (HAS_INDIRECT) {
        sum += indirect[index].rgb;
    }
    radiance[index] = vec4f(sum, 1.0 - emission[index].a);
}
