// One invocation adds up a pixel's irradiance: of its disc at the first level; of the ring of the next coarser level,
// smoothed, since each pixel takes a part of its samples; and of all coarser levels. In: surfels, irradiance, W/m2. Out:
// irradiance, and the distance of its surface, metres, 0 where there is none.
#import "ssil/upsample.wgsl"

override HAS_DISC: bool = true;
override HAS_COARSE: bool = true;

@group(1) @binding(13) var surfels: texture_storage_2d<rgba32uint, read>;
@group(1) @binding(14) var<storage, read> disc: array<vec4f>;
@group(1) @binding(15) var<storage, read_write> combined: array<vec4f>;
@group(1) @binding(16) var<storage, read> ring: array<vec4f>;

// Returns the mean of the ring's light over 3x3 pixels, where they are of one surface.
fn smoothed(pixel: vec2u, position: vec3f, normal: vec3f) -> vec3f {
    let size = vec2i(textureDimensions(surfels));
    let per_width = pixels_per_metre(position) * f32(size.x) / f32(view.size.x);
    var sum = vec3f(0.0);
    var weights = 0.0;
    for (var k = 0; k < 9; k += 1) {
        let step = vec2i(k % 3, k / 3) - 1;
        let at = clamp(vec2i(pixel) + step, vec2i(0), size - 1);
        let other = textureLoad(surfels, vec2u(at));
        // A tent: each of the four parts of the samples counts as much as the others.
        let share = f32((2 - abs(step.x)) * (2 - abs(step.y)));
        let weight = select(share * sameness(position, normal, other, per_width), 0.0, is_empty(other));
        sum += weight * ring[at.y * size.x + at.x].rgb;
        weights += weight;
    }
    return sum / max(weights, 1e-30);
}

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
    let position = surfel_position(texel);
    var sum = smoothed(id.xy, position, surfel_normal(texel));
    if (HAS_COARSE) {
        sum += upsample(id.xy, texel, 2.0).irradiance;
    }
    if (HAS_DISC) {
        sum += disc[index].rgb;
    }
    combined[index] = vec4f(sum, length(position));
}
