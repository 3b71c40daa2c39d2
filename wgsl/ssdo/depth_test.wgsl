// Tests a point against the depth buffers of one view: whether it lies behind a surface, and by what distance (Ritschel
// et al. 2009, section 3; several layers and cameras: section 4.)
#import "ssdo/hit_position.wgsl"

// Relative error of a depth: float32 projection and interpolation by the rasteriser. tools/README.md, "Constants".
const RASTER_ROUNDING: f32 = 4e-6;
// Error of a tangent plane's depth, relative to its terms. tools/README.md, "Constants".
const PLANE_ROUNDING: f32 = 1e-5;
// Rasterisers snap corners to a grid of 1/16 pixel or finer (Vulkan's least `subPixelPrecisionBits` is 4), which shifts
// a triangle's depths by up to this many pixels along each axis. SwiftShader's grid is that coarse.
const SNAP: f32 = 1.0 / 32.0;
// Distance in pixels from the receiver's own place within which a further camera's depths are ignored: if it sees the
// receiver's surface edge-on or not at all, these pixels show other surfaces. tools/README.md, "Constants".
const LEAST_SEPARATION: f32 = 1.5;

// A receiver in a view. Clip space is scaled so that x / w and y / w are pixels.
struct ReceiverInView {
    clip: vec4f,
    axes: mat3x4f,          // change of `clip` per metre along each axis of directions
    plane: vec3f,           // depth of the tangent plane at pixel (x, y), with rounding: dot(plane, (x, y, 1))
    pixel: vec2f,
    towards_camera: vec2f,  // change of z and w of `clip` per metre towards the camera
    size: vec2f,            // of the picture, pixels
    rounding: vec2f,        // rounding lifts a depth d to rounding.x + rounding.y d
}

// Projects a receiver. `frame` has the axes of directions, `tangents` the surface's two tangents first.
fn receiver_in_view(v: View, position: vec3f, frame: mat3x3f, tangents: mat3x3f) -> ReceiverInView {
    let size = vec2f(v.size);
    let pixels_from_ndc = mat4x4f(
        vec4f(0.5 * size.x, 0.0, 0.0, 0.0), vec4f(0.0, -0.5 * size.y, 0.0, 0.0), vec4f(0.0, 0.0, 1.0, 0.0),
        vec4f(0.5 * size, 0.0, 1.0));
    let m = pixels_from_ndc * v.clip_from_world;
    let clip = m * vec4f(position, 1.0);
    let axes = mat3x4f(m * vec4f(frame[0], 0.0), m * vec4f(frame[1], 0.0), m * vec4f(frame[2], 0.0));
    // Derivatives of pixel and depth along both tangents, from the quotient rule, give the slope of the plane's depth.
    let place = clip.xyz / clip.w;
    let tangent_a = m * vec4f(tangents[0], 0.0);
    let tangent_b = m * vec4f(tangents[1], 0.0);
    let a = tangent_a.xyz - place * tangent_a.w;
    let b = tangent_b.xyz - place * tangent_b.w;
    let determinant = a.x * b.y - a.y * b.x;
    let has_slope = determinant != 0.0;
    let slope = vec2f(a.z * b.y - b.z * a.y, b.z * a.x - a.z * b.x) / select(1.0, determinant, has_slope);
    // A plane seen edge-on covers no pixels: give it depth 0, behind everything.
    let is_known = has_slope && all(abs(slope) < vec2f(1e30)) && clip.w > 0.0;
    let at = place.z - dot(slope, place.xy);
    let rounded = at + PLANE_ROUNDING * (dot(abs(slope), size) + abs(at)) + SNAP * (abs(slope.x) + abs(slope.y));
    let parallel = v.orthographic != 0u;
    return ReceiverInView(
        clip, axes, select(vec3f(0.0), vec3f(slope, rounded), is_known), place.xy, -(m * vec4f(v.forward, 0.0)).zw,
        size, select(vec2f(0.0, 1.0 + RASTER_ROUNDING), vec2f(RASTER_ROUNDING, 1.0), parallel));
}

// A point along a direction, in a view.
struct MarchPoint {
    clip: vec2f,           // z and w
    pixel: vec2i,
    is_inside: bool,       // the picture
    is_separate: bool,     // farther than LEAST_SEPARATION from the receiver's own pixel
    depth: f32,            // with rounding
    plane_depth: f32,      // of the receiver's tangent plane at the pixel, with rounding
    occluder_depth: f32,   // least depth of an occluder: before the point and before the receiver's own surface
}

// Returns the point `t` metres along a direction; `along`: the change of clip space per metre.
fn project_point(r: ReceiverInView, along: vec4f, t: f32) -> MarchPoint {
    let clip = r.clip + t * along;
    let place = clip.xyz * (1.0 / clip.w);
    let is_inside = clip.w > 0.0 && all(place.xy >= vec2f(0.0)) && all(place.xy < r.size);
    let corner = floor(select(vec2f(0.0), place.xy, is_inside));
    let plane_depth = dot(r.plane, vec3f(corner + 0.5, 1.0));
    let depth = place.z * r.rounding.y + r.rounding.x;
    let is_separate = max(abs(place.x - r.pixel.x), abs(place.y - r.pixel.y)) > LEAST_SEPARATION;
    return MarchPoint(clip.zw, vec2i(corner), is_inside, is_separate, depth, plane_depth, max(depth, plane_depth));
}

// Returns the distance of a point behind a depth, metres along the view.
fn distance_behind(r: ReceiverInView, point: MarchPoint, depth: f32) -> f32 {
    return (depth * point.clip.y - point.clip.x) / (r.towards_camera.x - depth * r.towards_camera.y);
}

struct DepthTest {
    behind: f32,          // distance behind a surface, metres along the view; FLOAT_MAX: behind none
    hit: u32,             // that surface, packed by `pack_hit`
    is_open: bool,        // the view shows that the point is in free space
    is_crossed: bool,     // the direction passed through the surface since the last point
    is_past_first: bool,  // the point lies behind the first layer, too, and `hit` is not of that layer
}

// Tests a point against a single depth.
fn test_depth(r: ReceiverInView, point: MarchPoint, depth: f32, source: u32) -> DepthTest {
    let is_behind =
        point.is_inside && depth > point.occluder_depth && (point.is_separate || source < FIRST_CAMERA);
    return DepthTest(
        select(FLOAT_MAX, distance_behind(r, point, depth), is_behind), pack_hit(vec2u(point.pixel), source),
        point.is_inside && depth < point.depth, false, false);
}

// Whether a further camera sees a cover over the receiver, such as a roof seen from above. Points under a cover do not
// count as inside matter: only leaving through the cover is a hit.
struct Cover {
    is_covered: bool,
    behind: f32,  // distance of the last point behind the cover, metres along the view; FLOAT_MAX: unknown
    hit: u32,     // the cover at the last point
}

// Returns the point that decides whether a receiver is covered: LEAST_SEPARATION pixels off its surface along the
// normal, so that a wall seen edge-on does not cover itself, but a ceiling seen from above does.
fn cover_point(v: View, r: ReceiverInView) -> MarchPoint {
    let pixel_width = 2.0 * length(v.up) / f32(v.size.y) * r.clip.w;
    return project_point(r, r.axes[2], LEAST_SEPARATION * pixel_width);
}

fn start_cover(point: MarchPoint, depth: f32, source: u32) -> Cover {
    return Cover(point.is_inside && depth > point.depth, FLOAT_MAX, pack_hit(vec2u(point.pixel), source));
}

// Tests a point against a further camera and updates its cover. `advance`: the point's view depth minus the previous
// point's, metres; `radius`: r_max, metres.
fn test_further_camera(
    r: ReceiverInView, point: MarchPoint, depth: f32, source: u32, cover: ptr<function, Cover>, advance: f32,
    radius: f32
) -> DepthTest {
    let open_test = test_depth(r, point, depth, source);
    let is_behind = point.is_inside && depth > point.depth;
    // The direction leaves through the cover if it advanced by the cover's distance, otherwise past the cover's border.
    let leaves_through = point.is_inside && !is_behind && (*cover).behind <= -advance;
    // The camera shows the far side of the cover: rank this hit at distance `radius`, behind hits of other cameras.
    let covered_test = DepthTest(
        select(FLOAT_MAX, radius, leaves_through), (*cover).hit, !is_behind && open_test.is_open && !leaves_through,
        leaves_through, false);
    let was_covered = (*cover).is_covered;
    // At the receiver's own pixel the camera may show the top of the receiver's own wall, so the distance is unknown.
    *cover = Cover(
        was_covered && (is_behind || !point.is_separate),
        select(FLOAT_MAX, distance_behind(r, point, depth), point.is_separate),
        pack_hit(vec2u(point.pixel), source));
    return DepthTest(
        select(open_test.behind, covered_test.behind, was_covered),
        select(open_test.hit, covered_test.hit, was_covered),
        select(open_test.is_open, covered_test.is_open, was_covered), was_covered && leaves_through, false);
}

// Tests a point against the layers of the main camera. With several layers, parity decides: the point is inside matter
// if an odd number of layers lies in front of it. `advance`: the point's view depth minus the previous point's, metres.
fn test_layers(r: ReceiverInView, point: MarchPoint, advance: f32) -> DepthTest {
    let first = textureLoad(depth_0, point.pixel, 0);
    if (LAYERS == 1u) {
        return test_depth(r, point, first, 0u);
    }
    let second = textureLoad(depth_1, point.pixel, 0);
    let is_past_first = point.is_inside && first > point.occluder_depth;
    let is_past_second = second > point.occluder_depth;
    var is_odd = !is_past_second;                        // parity of the layers in front, if the first is in front
    var face = select(0u, 1u, is_past_second);           // the last layer in front
    var entry = first;                                   // depth of the last odd layer in front: matter begins there
    var next = select(second, 0.0, is_past_second);      // depth of the next layer behind the point, 0: none
    var is_past_all = is_past_second;                    // behind all layers: nothing is known there
    if (LAYERS > 2u) {
        let third = textureLoad(depth_2, point.pixel, 0);
        let is_past_third = third > point.occluder_depth;
        is_odd = is_odd | is_past_third;
        face = select(face, 2u, is_past_third);
        entry = select(entry, third, is_past_third);
        next = select(select(next, third, is_past_second), 0.0, is_past_third);
        is_past_all = is_past_third;
        if (LAYERS > 3u) {
            let fourth = textureLoad(depth_3, point.pixel, 0);
            let is_past_fourth = fourth > point.occluder_depth;
            is_odd = is_odd & !is_past_fourth;
            face = select(face, 3u, is_past_fourth);
            next = select(select(next, fourth, is_past_third), 0.0, is_past_fourth);
            is_past_all = is_past_fourth;
        }
    }
    let behind = distance_behind(r, point, entry);
    let has_far_face = next > 0.0;
    // A point in free space that is nearer to the entry than the step's length: the step passed in and out of matter.
    let is_crossed = !is_odd & (behind < advance);
    // Find the face that the direction hits: a front face if it leads away from the camera, the back face if it leads
    // towards the camera, the entry if the step passed through matter.
    face += select(0u, 1u, is_odd & has_far_face & (advance < 0.0));
    face -= select(0u, 1u, is_crossed);
    let is_occluded = is_past_first & (is_odd | is_crossed);
    let is_open =
        point.is_inside && !is_occluded && ((is_past_first && !is_past_all) || first < point.depth);
    // Matter between two known faces occludes at any thickness.
    return DepthTest(
        select(FLOAT_MAX, select(behind, 0.0, has_far_face | is_crossed), is_occluded),
        pack_hit(vec2u(point.pixel), face), is_open, false, is_past_first & (!is_occluded | (face > 0u)));
}

// Combines the tests of two views: the nearest surface that the point lies behind, and whether either view shows the
// point in free space.
fn combine_tests(a: DepthTest, b: DepthTest) -> DepthTest {
    return DepthTest(
        min(a.behind, b.behind), select(b.hit, a.hit, a.behind <= b.behind), a.is_open || b.is_open,
        a.is_crossed || b.is_crossed, a.is_past_first || b.is_past_first);
}
