// One invocation combines the irradiance of a pixel of the first level: that of its disc, and that of the rings of all
// coarser levels, filtered over 3x3 pixels, since neighbours use different samples. Near light changes too much from
// pixel to pixel to be filtered.
//
// E = E_disc + sum_j w_j E_ring,j / sum_j w_j (section 4, "Continuous combination of all levels"). In: surfels;
// irradiance, W/m2. Out: irradiance, and in w the distance of the surface, metres, 0 without a surface. Errs by blurring
// over three pixels.
#import "ssil/guide_surface.wgsl"

@group(1) @binding(13) var surfels: texture_storage_2d<rgba32uint, read>;
@group(1) @binding(14) var<storage, read> disc: array<vec4f>;
@group(1) @binding(15) var<storage, read_write> combined: array<vec4f>;
@group(1) @binding(16) var<storage, read> ring: array<vec4f>;
@group(1) @binding(17) var<storage, read> before: array<vec4f>;
@group(1) @binding(18) var<storage, read_write> total: array<vec4f>;

// Returns the mean irradiance of the rings over 3x3 pixels of the same surface.
fn smoothed(pixel: vec2u, own: GuideSurface) -> vec3f {
    let size = vec2i(textureDimensions(surfels));
    let per_metre = pixels_per_metre(own.position) * f32(size.x) / f32(view.size.x);
    var sum = vec3f(0.0);
    var weights = 0.0;
    for (var k = 0; k < 9; k += 1) {
        let step = vec2i(k % 3, k / 3) - 1;
        let at = clamp(vec2i(pixel) + step, vec2i(0), size - 1);
        let other = surfel_guide_surface(textureLoad(surfels, vec2u(at)));
        // A tent filter: each of the patterns of 2x2 pixels gets the same total weight.
        let share = f32((2 - abs(step.x)) * (2 - abs(step.y)));
        let weight = share * similarity(own, other, per_metre);
        sum += weight * ring[at.y * size.x + at.x].rgb;
        weights += weight;
    }
    return sum / max(weights, 1e-30);
}

// Returns the irradiance of a pixel and, in w, the distance of its surface, metres.
fn combined_at(pixel: vec2u) -> vec4f {
    let texel = textureLoad(surfels, pixel);
    if (is_empty(texel)) {
        return vec4f(0.0);
    }
    let own = surfel_guide_surface(texel);
    let near = disc[pixel.y * textureDimensions(surfels).x + pixel.x].rgb;
    return vec4f(near + smoothed(pixel, own), length(own.position));
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
