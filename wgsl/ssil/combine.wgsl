// One invocation combines the irradiance of a pixel: the disc of the first level, the ring of the next coarser level,
// filtered over 3x3 pixels since each pixel takes a quarter of the samples, and the upsampled sum of the coarser
// levels.
//
// E = E_disc + sum_j w_j E_ring,j / sum_j w_j + up(E_coarse) (section 4, "Continuous combination of all levels"). In:
// surfels; irradiance, W/m2. Out: irradiance, and in w the distance of the surface, metres, 0 without a surface. Errs
// by blurring over a coarse pixel.
#import "ssil/guide_surface.wgsl"
#import "shared/upsample/once.wgsl"

override HAS_DISC: bool = true;
override HAS_COARSE: bool = true;

@group(1) @binding(12) var coarse_surfels: texture_storage_2d<rgba32uint, read>;
@group(1) @binding(13) var surfels: texture_storage_2d<rgba32uint, read>;
@group(1) @binding(14) var<storage, read> disc: array<vec4f>;
@group(1) @binding(15) var<storage, read_write> combined: array<vec4f>;
@group(1) @binding(16) var<storage, read> ring: array<vec4f>;
@group(1) @binding(17) var<storage, read> before: array<vec4f>;
@group(1) @binding(18) var<storage, read_write> total: array<vec4f>;

// Returns the mean irradiance of the ring over 3x3 pixels of the same surface.
fn smoothed(pixel: vec2u, own: GuideSurface) -> vec3f {
    let size = vec2i(textureDimensions(surfels));
    let per_metre = pixels_per_metre(own.position) * f32(size.x) / f32(view.size.x);
    var sum = vec3f(0.0);
    var weights = 0.0;
    for (var k = 0; k < 9; k += 1) {
        let step = vec2i(k % 3, k / 3) - 1;
        let at = clamp(vec2i(pixel) + step, vec2i(0), size - 1);
        let other = surfel_guide_surface(textureLoad(surfels, vec2u(at)));
        // A tent filter: each quarter of the samples gets the same total weight.
        let share = f32((2 - abs(step.x)) * (2 - abs(step.y)));
        let weight = share * similarity(own, other, per_metre);
        sum += weight * ring[at.y * size.x + at.x].rgb;
        weights += weight;
    }
    return sum / max(weights, 1e-30);
}

fn coarse_surface(pixel: vec2u) -> GuideSurface {
    return surfel_guide_surface(textureLoad(coarse_surfels, pixel));
}

// Returns the irradiance of a pixel and, in w, the distance of its surface, metres.
fn combined_at(pixel: vec2u) -> vec4f {
    let texel = textureLoad(surfels, pixel);
    if (is_empty(texel)) {
        return vec4f(0.0);
    }
    let own = surfel_guide_surface(texel);
    var sum = smoothed(pixel, own);
    if (HAS_COARSE) {
        let coarse_size = textureDimensions(coarse_surfels);
        let per_metre = pixels_per_metre(own.position) * f32(coarse_size.x) / f32(view.size.x);
        sum += upsampled_once(pixel, own, coarse_size, per_metre);
    }
    if (HAS_DISC) {
        sum += disc[pixel.y * textureDimensions(surfels).x + pixel.x].rgb;
    }
    return vec4f(sum, length(own.position));
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(surfels);
    if (all(id.xy < size)) {
        combined[id.y * size.x + id.x] = combined_at(id.xy);
    }
}

// Does the same, and adds the previous bounces.
@compute @workgroup_size(8, 8)
fn with_total(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(surfels);
    if (all(id.xy < size)) {
        let index = id.y * size.x + id.x;
        let found = combined_at(id.xy);
        combined[index] = found;
        total[index] = vec4f(before[index].rgb + found.rgb, found.w);
    }
}
