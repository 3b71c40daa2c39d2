// One invocation finds the guide of the blur for a pixel: its mean luminance with the variance of that mean, and the same
// of the 3x3 pixels around it on the same surface. A pixel's own values tell detail from noise, its neighbourhood's tell
// fainter edges, since their variance is lower (Buades et al. 2005, "A Non-Local Algorithm for Image Denoising").
//
// In: the luminance's moments over the frames of a still picture; or light of one frame, with variances, for which the
// pixel's own values are left out. Light has depths. Out: guide, W/m2 and its square, of variances in units of
// `scene.light_unit`.
#import "shared/denoise/guide.wgsl"

override FIRST: bool = false;   // light of one frame, with variances
override SHARES: bool = false;  // the light is a share, from 0 to 1

@group(1) @binding(11) var<storage, read> light: array<vec4f>;
@group(1) @binding(12) var<storage, read> normals: array<u32>;
@group(1) @binding(13) var<storage, read_write> neighbours: array<vec4f>;  // mean and variance: own, of 3x3 pixels
@group(1) @binding(14) var<storage, read> variances: array<f32>;  // of the luminance of each pixel
@group(1) @binding(15) var<storage, read> moments: array<vec2f>;

// Pixel widths from the tangent plane, and cosine of the normals, of neighbours.
const MOST_OFF_PLANE: f32 = 1.0;
const MIN_NORMAL_COSINE: f32 = 0.8;

// Returns the mean luminance of a pixel and the variance of that mean.
fn mean_of(index: u32) -> vec2f {
    if (FIRST) {
        return vec2f(min(luminance(light[index].rgb) / scene.light_unit, 1e18), variances[index]);
    }
    let m = moments[index];
    return vec2f(m.x, max(m.y - m.x * m.x, 0.0) / f32(max(sequence.still, 1u)));
}

// Returns the variance of the mean of `count` pixels that few samples of visibility hide: all may agree by chance. Adds
// two samples that disagree, which move the mean by 2 / samples.
fn hidden_variance(count: f32) -> f32 {
    let samples = count * f32(sequence.still + 1u);
    return select(0.0, 4.0 / (samples * samples), SHARES);
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (any(id.xy >= grid_size())) {
        return;
    }
    let index = id.y * grid_size().x + id.x;
    let depth = light[index].w;
    let normal = unpack_view_normal(normals[index]);
    let plane = tangent_plane(grid_pixel(id.xy), depth, normal);
    var sum = vec3f(0.0);
    for (var k = 0; k < 9; k += 1) {
        let offset = vec2i(k % 3, k / 3) - 1;
        let place = vec2i(id.xy) + offset;
        if (any(place < vec2i(0)) || any(place >= vec2i(grid_size()))) {
            continue;
        }
        let other = u32(place.y) * grid_size().x + u32(place.x);
        let other_depth = light[other].w;
        let off = abs(plane.at + dot(plane.across, vec2f(offset * i32(STRIDE))) - plane.factor * other_depth);
        let faces = dot(normal, unpack_view_normal(normals[other]));
        if (other_depth > 0.0 && off < MOST_OFF_PLANE * f32(STRIDE) && faces > MIN_NORMAL_COSINE) {
            sum += vec3f(mean_of(other), 1.0);
        }
    }
    let count = max(sum.z, 1.0);
    var own = vec2f(0.0);
    if (!FIRST) {
        own = mean_of(index) + vec2f(0.0, hidden_variance(1.0));
    }
    neighbours[index] = vec4f(own, sum.x / count, sum.y / (count * count) + hidden_variance(count));
}
