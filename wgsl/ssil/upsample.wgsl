// Joint bilateral upsampling (Kopf et al. 2007): light of a coarser level for a surfel of a finer one.
#import "ssil/surfel.wgsl"

@group(1) @binding(11) var coarse_surfels: texture_storage_2d<rgba32uint, read>;
@group(1) @binding(12) var<storage, read> coarse: array<vec4f>;

@group(1) @binding(17) var<storage, read> coarse_glossy: array<vec4f>;

override HAS_GLOSSY: bool = false;  // upsampled with it

// A neighbour counts as another surface if it is off the tangent plane by this many widths of its pixel, or if the
// cosine of the normals differs from 1 by this. Chosen.
const OFF_PLANE: f32 = 1.0;
const OFF_NORMAL: f32 = 0.3;
// Weight of a neighbour that is another surface, for pixels that have no other. Chosen.
const LEAST: f32 = 1e-4;

struct Upsampled {
    irradiance: vec3f,
    glossy: vec3f,
}

// Returns how much a coarser surfel is of one surface with a finer one, 0 to 1; `per_width` turns metres into widths of
// the coarser pixel.
fn sameness(position: vec3f, normal: vec3f, other: vec4u, per_width: f32) -> f32 {
    let off = dot(normal, surfel_position(other) - position) * per_width;
    let turned = 1.0 - dot(normal, surfel_normal(other));
    return max(1.0 - off * off / (OFF_PLANE * OFF_PLANE), 0.0) * max(1.0 - turned / OFF_NORMAL, 0.0);
}

// Returns the light at a pixel of a level that has SQUARE^2 pixels for each coarse one.
fn upsample(pixel: vec2u, texel: vec4u, square: f32) -> Upsampled {
    let size = vec2i(textureDimensions(coarse_surfels));
    let place = (vec2f(pixel) + 0.5) / square - 0.5;
    let corner = vec2i(floor(place));
    let f = place - floor(place);
    let position = surfel_position(texel);
    let normal = surfel_normal(texel);
    let per_width = pixels_per_metre(position) * f32(size.x) / f32(view.size.x);
    var sum = vec3f(0.0);
    var shine = vec3f(0.0);
    var weights = 0.0;
    for (var k = 0; k < 4; k += 1) {
        let offset = vec2i(k & 1, k >> 1u);
        let at = clamp(corner + offset, vec2i(0), size - 1);
        let other = textureLoad(coarse_surfels, vec2u(at));
        let share = select(1.0 - f, f, offset > vec2i(0));
        let same = sameness(position, normal, other, per_width);
        let weight = select(share.x * share.y * max(same, LEAST), 0.0, is_empty(other));
        sum += weight * coarse[at.y * size.x + at.x].rgb;
        if (HAS_GLOSSY) {
            shine += weight * coarse_glossy[at.y * size.x + at.x].rgb;
        }
        weights += weight;
    }
    let scale = select(1.0 / max(weights, 1e-30), 0.0, weights <= 0.0);
    return Upsampled(sum * scale, shine * scale);
}
