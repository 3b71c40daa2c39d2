// One invocation finds the mean luminance of a pixel and its neighbours on the same surface, and the variance of that
// mean: the guide of a blur within one frame. In: light, with depth; normals; variances. Out: guide, in units
// of `scene.light_unit` and their square.
#import "shared/denoise/plane.wgsl"
#import "common/math.wgsl"

@group(1) @binding(11) var<storage, read> light: array<vec4f>;
@group(1) @binding(12) var<storage, read> normals: array<u32>;
@group(1) @binding(13) var<storage, read_write> guide: array<vec2f>;
@group(1) @binding(14) var<storage, read> variances: array<f32>;  // of the luminance of each pixel

// As in `shared/denoise/blur.wgsl`.
const OFF_PLANE: f32 = 1.0;   // pixel widths
const MIN_NORMAL_COSINE: f32 = 0.8;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (any(id.xy >= view.size)) {
        return;
    }
    let index = id.y * view.size.x + id.x;
    let depth = light[index].w;
    let normal = unpack_view_normal(normals[index]);
    let plane = tangent_plane(id.xy, depth, normal);
    var sum = vec3f(0.0);
    for (var k = 0; k < 9; k += 1) {
        let offset = vec2i(k % 3, k / 3) - 1;
        let place = vec2i(id.xy) + offset;
        if (any(place < vec2i(0)) || any(place >= vec2i(view.size))) {
            continue;
        }
        let other = u32(place.y) * view.size.x + u32(place.x);
        let tap = light[other];
        let off = abs(plane.at + dot(plane.across, vec2f(offset)) - plane.factor * tap.w);
        let faces = dot(normal, unpack_view_normal(normals[other]));
        if (tap.w > 0.0 && off < OFF_PLANE && faces > MIN_NORMAL_COSINE) {
            sum += vec3f(min(luminance(tap.rgb) / scene.light_unit, 1e18), variances[other], 1.0);
        }
    }
    let count = max(sum.z, 1.0);
    guide[index] = vec2f(sum.x / count, sum.y / (count * count));
}
