// One invocation adds to a pixel's irradiance that of all coarser levels. In: surfels, irradiance of both, W/m2. Out:
// irradiance, and the distance of its surface, metres, 0 where there is none.
#import "ssil/upsample.wgsl"

@group(1) @binding(13) var surfels: texture_storage_2d<rgba32uint, read>;
@group(1) @binding(14) var<storage, read> own: array<vec4f>;
@group(1) @binding(15) var<storage, read_write> combined: array<vec4f>;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(surfels);
    if (any(id.xy >= size)) {
        return;
    }
    let index = id.y * size.x + id.x;
    let texel = textureLoad(surfels, id.xy);
    if (is_empty(texel)) {
        combined[index] = vec4f(0.0);
        return;
    }
    combined[index] = vec4f(own[index].rgb + upsample(id.xy, texel, 2.0).irradiance, length(surfel_position(texel)));
}
