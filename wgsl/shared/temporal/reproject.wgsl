// One invocation finds the history of a pixel's surface: the mean light that the previous frame had for it.
//
// `motion` gives the previous position; of the four taps there, those off the surface's plane or with another normal get
// weight 0 (Nehab et al. 2007, "Accelerating Real-Time Shading with Reverse Reprojection Caching"). In: irradiance
// (depth 0: nothing to light), motion, the previous history. Out: the history at the pixel, with the surface of this
// frame, and its spread and random numbers; its rejected share, 0 to 1. Errs blurry: bilinear taps blur the light a
// little in each frame.
#import "shared/gbuffer/load.wgsl"
#import "shared/temporal/history.wgsl"
#import "shared/denoise/plane.wgsl"

@group(0) @binding(2) var<uniform> view_before: View;
@group(1) @binding(11) var<storage, read> irradiance: array<vec4f>;
@group(1) @binding(12) var<storage, read> motion: array<vec4f>;
@group(1) @binding(13) var<storage, read> previous: array<vec4u>;     // the previous frame's history
@group(1) @binding(14) var<storage, read_write> found: array<vec4u>;
@group(1) @binding(15) var<storage, read_write> usual: array<vec2f>;  // spread, random numbers
@group(1) @binding(16) var<storage, read_write> rejected: array<f32>;

// A tap shows the same surface if it is off its plane by at most this many pixel widths, and if the normals' cosine is
// at least this (26 degrees). tools/README.md, "Constants".
const MAX_PLANE_DISTANCE: f32 = 1.0;
const MIN_NORMAL_COSINE: f32 = 0.9;
// The history is dropped if accepted taps weigh less than this: less than a tenth of a pixel is mostly noise.
// tools/README.md, "Constants".
const MIN_HISTORY_WEIGHT: f32 = 0.1;

// Returns the point at a distance along a ray of the previous frame through a point of its whole picture.
fn point_before(pixel: vec2f, seen: f32) -> vec3f {
    let ray = ray_of(view_before, pixel + view_before.offset);
    return ray.origin + ray.direction * seen;
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (any(id.xy >= view.size)) {
        return;
    }
    let index = id.y * view.size.x + id.x;
    if (irradiance[index].w <= 0.0) {
        found[index] = vec4u(0u);
        usual[index] = vec2f(0.0);
        rejected[index] = 0.0;
        return;
    }
    let surface = load_surface(id.xy);
    let moved = motion[index];
    let place = vec2f(whole_pixel(id.xy)) - moved.xy;
    let corner = vec2i(floor(place));
    let f = place - floor(place);
    let expected = point_before(place, moved.z);
    let far = select(moved.z, 1.0, view_before.orthographic != 0u);
    let width = far * 2.0 * length(view_before.up) / f32(view_before.whole.y);
    // Filter the history bilinearly over the taps that show the same surface.
    var light = vec3f(0.0);
    var frames = 0.0;
    var weight = 0.0;
    var spread = 0.0;
    var drawn = 0u;
    for (var k = 0; k < 4; k += 1) {
        let offset = vec2i(k & 1, k >> 1u);
        let place_before = corner + offset;  // in the whole picture
        let pixel = place_before - vec2i(view.corner);
        let share = select(1.0 - f, f, offset > vec2i(0));
        let inside = all(pixel >= vec2i(0)) && all(pixel < vec2i(view.size));
        if (!inside || moved.w <= 0.0) {
            continue;
        }
        let h = unpack_history(previous[u32(pixel.y) * view.size.x + u32(pixel.x)]);
        let off_plane = abs(dot(surface.geometric_normal, point_before(vec2f(place_before), h.distance) - expected));
        let same = h.frames > 0.0 && off_plane <= MAX_PLANE_DISTANCE * width
            && dot(h.normal, surface.normal) >= MIN_NORMAL_COSINE;
        let w = select(0.0, share.x * share.y, same);
        light += w * h.light;
        frames += w * h.frames;
        spread += w * h.spread;
        weight += w;
        drawn = select(drawn, h.drawn, w > 0.0);
    }
    let enough = weight > MIN_HISTORY_WEIGHT;
    let inverse = select(0.0, 1.0 / max(weight, MIN_HISTORY_WEIGHT), enough);
    let depth = plane_depth(pixel_ray(id.xy), load_distance(id.xy));
    found[index] = pack_found(Found(light * inverse, frames * inverse, depth, pack_view_normal(surface.normal)));
    usual[index] = vec2f(spread * inverse, f32(drawn));
    rejected[index] = 1.0 - weight;
}
