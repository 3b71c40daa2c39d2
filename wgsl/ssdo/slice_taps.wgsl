// The pixels along a slice of the hemisphere (taps), and their surfaces in the slice's coordinates.
//
// The slice through the eye and the receiver projects to a line of the picture. Points are relative to the receiver, in
// coordinates (x, y) along the slice's axis and tangent. A pixel's centre lies up to half a pixel off the line: its
// point is moved onto the slice along the receiver's surface, so that flat surfaces do not cover themselves.
#import "ssdo/slice.wgsl"
#import "ssdo/hit_position.wgsl"

// Distance of the first tap from the receiver, pixels: at least this is in another pixel.
const FIRST_TAP: f32 = 1.0;
// Least length of the surface normal's part in the slice; below it, points move by its direction only.
const LEAST_NORMAL_PART: f32 = 0.05;

// The line of a slice in the picture. Dot products with `axis` and `tangent` give coordinates of the slice.
struct SliceLine {
    step: vec2f,     // along the line, of length 1 pixel
    axis: vec3f,
    tangent: vec3f,
    horizon: vec2f,  // unit vector of the slice along the surface, on the positive side
}

// `side`: geometric normal, unit, towards the eye. `place`: of the receiver, pixels.
fn slice_line(slice: Slice, side: vec3f, place: vec2f) -> SliceLine {
    // Project the tangent into the picture.
    let extent = vec2f(dot(view.right, view.right), dot(view.up, view.up));
    let ndc = place / vec2f(view.size) * vec2f(2.0, -2.0) + vec2f(-1.0, 1.0);
    let across = vec2f(dot(slice.tangent, view.right), dot(slice.tangent, view.up)) / extent;
    let moved = across - select(ndc * dot(slice.tangent, view.forward), vec2f(0.0), view.orthographic != 0u);
    let step = normalize(moved * vec2f(view.size) * vec2f(1.0, -1.0));
    // The surface's axes in the slice: its tangent, and its normal divided by the length of the normal's part there.
    let part = vec2f(dot(side, slice.axis), dot(side, slice.tangent));
    let inverse = inverseSqrt(max(dot(part, part), 1e-12));
    let unit = part * inverse;
    let normal = side * min(inverse, 1.0 / LEAST_NORMAL_PART);
    let tangent = unit.x * slice.tangent - unit.y * slice.axis;
    return SliceLine(
        step, unit.x * normal - unit.y * tangent, unit.x * tangent + unit.y * normal, vec2f(-unit.y, unit.x));
}

// A view in the slice's coordinates.
struct SliceView {
    right: vec2f,
    up: vec2f,
    forward: vec2f,
    receiver: vec2f,  // relative to the camera
    start: vec2f,     // z and w of clip space at the camera
    change: vec2f,    // ... per metre of view depth
}

fn slice_view(line: SliceLine, position: vec3f, v: View) -> SliceView {
    let m = v.clip_from_world;
    let offset = position - v.position;
    return SliceView(
        vec2f(dot(v.right, line.axis), dot(v.right, line.tangent)),
        vec2f(dot(v.up, line.axis), dot(v.up, line.tangent)),
        vec2f(dot(v.forward, line.axis), dot(v.forward, line.tangent)),
        vec2f(dot(offset, line.axis), dot(offset, line.tangent)),
        (m * vec4f(v.position, 1.0)).zw, (m * vec4f(v.forward, 0.0)).zw);
}

// A pixel of a view and its ray in the slice's coordinates: the point at view depth d is start + d * change.
struct Tap {
    pixel: vec2u,
    is_inside: bool,  // the picture
    at: f32,          // distance from the receiver along the line, pixels of the main view
    start: vec2f,
    change: vec2f,
}

// Returns the tap at a place of a view, pixels.
fn tap_at(s: SliceView, place: vec2f, at: f32) -> Tap {
    let is_inside = all(place >= vec2f(0.0)) && all(place < vec2f(view.size));
    let pixel = vec2u(select(vec2f(0.0), place, is_inside));
    let ndc = (vec2f(pixel) + view.offset) / vec2f(view.size) * vec2f(2.0, -2.0) + vec2f(-1.0, 1.0);
    let aside = ndc.x * s.right + ndc.y * s.up;
    let parallel = view.orthographic != 0u;
    return Tap(
        pixel, is_inside, at, select(vec2f(0.0), aside, parallel) - s.receiver,
        s.forward + select(aside, vec2f(0.0), parallel));
}

// The surface that a tap shows.
struct Shown {
    point: vec2f,
    view_depth: f32,  // metres
    at: f32,          // as in Tap
    is_known: bool,   // false: there is none
}

// `depth`: value of the depth buffer.
fn shown_at(s: SliceView, tap: Tap, depth: f32) -> Shown {
    let is_known = tap.is_inside && depth > 0.0;
    let safe = select(1.0, depth, is_known);
    let along = (safe * s.start.y - s.start.x) / (s.change.x - safe * s.change.y);
    return Shown(tap.start + along * tap.change, along, tap.at, is_known);
}

// Returns the distance along a line of the picture, in steps, from a place to the border.
fn steps_to_border(place: vec2f, step: vec2f) -> f32 {
    let size = vec2f(view.size);
    let to_border = select(place, size - place, step > vec2f(0.0)) / max(abs(step), vec2f(1e-6));
    return min(to_border.x, to_border.y);
}

// Returns the distance in the picture, pixels, beyond which no surface within r_max of the receiver appears. `depth`:
// the receiver's view depth, metres.
fn pixels_of_radius(radius: f32, depth: f32) -> f32 {
    let nearest = select(max(depth - radius, 1e-3 * depth), 1.0, view.orthographic != 0u);
    return radius * f32(view.size.y) / (2.0 * length(view.up) * nearest);
}

fn cross_2d(a: vec2f, b: vec2f) -> f32 {
    return a.x * b.y - a.y * b.x;
}

// Returns the point of a tap on the straight line through two surfaces before it. The inverse of its view depth, or
// with parallel rays the view depth, is linear over the picture.
fn continued(a: Shown, b: Shown, tap: Tap) -> vec2f {
    let parallel = view.orthographic != 0u;
    let at_a = select(1.0 / a.view_depth, a.view_depth, parallel);
    let at_b = select(1.0 / b.view_depth, b.view_depth, parallel);
    let at_tap = at_b + (at_b - at_a) * (tap.at - b.at) / max(b.at - a.at, 1e-3);
    // A line that recedes beyond the horizon ends there.
    let along = select(1.0 / max(at_tap, 1e-6 * at_b), at_tap, parallel);
    return tap.start + along * tap.change;
}

// Returns the distance in the picture, pixels, at which the line between two surfaces meets a direction.
fn crossing_at(a: Shown, b: Shown, direction: vec2f) -> f32 {
    let change = cross_2d(b.point - a.point, direction);
    let share = saturate(-cross_2d(a.point, direction) / select(1e-30, change, abs(change) > 1e-30));
    // Points between are linear over the picture after division by view depth.
    let parallel = view.orthographic != 0u;
    let weight_a = (1.0 - share) * select(a.view_depth, 1.0, parallel);
    let weight_b = share * select(b.view_depth, 1.0, parallel);
    return (a.at * weight_a + b.at * weight_b) / max(weight_a + weight_b, 1e-30);
}
