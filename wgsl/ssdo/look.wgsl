// What the camera's layers and further cameras know of a point: whether it lies behind a surface, and how far.
#import "ssdo/hits.wgsl"

// Rounding of float32 in the projection and of the interpolation by rasterisation, of the depth. Chosen.
const RASTER_ROUNDING: f32 = 4e-6;
// Likewise of the plane through a surface, of the terms that it is the sum of. Chosen.
const PLANE_ROUNDING: f32 = 1e-5;
// Pixels of a further camera, which may see the marcher's surface edge-on or not at all: nearer to it, a pixel shows
// what lies beside. Chosen.
const APART: f32 = 1.5;

// A point on a surface, the axes of its directions and its tangent plane, as a camera projects them: x and y of clip
// space are turned so that over w they are pixels.
struct InView {
    clip: vec4f,
    axes: mat3x4f,
    plane: vec3f,   // depth of the tangent plane, with rounding: x place.x + y place.y + z, in pixels
    place: vec2f,   // of the point, pixels
    nearer: vec2f,  // what z and w of clip space change by for a metre towards the camera
    size: vec2f,    // of the picture, pixels
    rounding: vec2f,  // of depths: of 1 and of themselves
}

// `frame` holds the axes of directions, the first two of `tangents` span the surface itself.
fn in_view(v: View, position: vec3f, frame: mat3x3f, tangents: mat3x3f) -> InView {
    let size = vec2f(v.size);
    let to_pixels = mat4x4f(
        vec4f(0.5 * size.x, 0.0, 0.0, 0.0), vec4f(0.0, -0.5 * size.y, 0.0, 0.0), vec4f(0.0, 0.0, 1.0, 0.0),
        vec4f(0.5 * size, 0.0, 1.0));
    let m = to_pixels * v.clip_from_world;
    let clip = m * vec4f(position, 1.0);
    let axes = mat3x4f(m * vec4f(frame[0], 0.0), m * vec4f(frame[1], 0.0), m * vec4f(frame[2], 0.0));
    // How place and depth change along the plane: derivatives of a projective map.
    let place = clip.xyz / clip.w;
    let a4 = m * vec4f(tangents[0], 0.0);
    let b4 = m * vec4f(tangents[1], 0.0);
    let a = a4.xyz - place * a4.w;
    let b = b4.xyz - place * b4.w;
    let slope = vec2f(a.z * b.y - b.z * a.y, b.z * a.x - a.z * b.x) / (a.x * b.y - a.y * b.x);
    // A plane seen edge-on covers no pixels; written so that a NaN fails.
    let known = all(abs(slope) < vec2f(1e30)) && clip.w > 0.0;
    let at = place.z - dot(slope, place.xy);
    let rounded = at + PLANE_ROUNDING * (dot(abs(slope), size) + abs(at));
    let parallel = v.orthographic != 0u;
    return InView(
        clip, axes, select(vec3f(0.0), vec3f(slope, rounded), known), place.xy, -(m * vec4f(v.forward, 0.0)).zw, size,
        select(vec2f(0.0, 1.0 + RASTER_ROUNDING), vec2f(RASTER_ROUNDING, 1.0), parallel));
}

// A point on the way along a direction, as a camera sees it.
struct Point {
    clip: vec2f,   // z and w
    pixel: vec2i,
    inside: bool,  // of the picture
    apart: bool,   // from the marcher's own place, so that its pixels do not show both
    depth: f32,    // that of the point, with rounding
    own: f32,      // that of the marcher's tangent plane at the pixel, with rounding
    least: f32,    // of what lies before the point and is not the marcher's own surface
}

fn point_on(p: InView, along: vec4f, way: f32) -> Point {
    let clip = p.clip + way * along;
    let place = clip.xyz * (1.0 / clip.w);
    let inside = clip.w > 0.0 && all(place.xy >= vec2f(0.0)) && all(place.xy < p.size);
    let corner = floor(select(vec2f(0.0), place.xy, inside));
    let own = dot(p.plane, vec3f(corner + 0.5, 1.0));
    let rounded = place.z * p.rounding.y + p.rounding.x;
    let apart = max(abs(place.x - p.place.x), abs(place.y - p.place.y)) > APART;
    return Point(clip.zw, vec2i(corner), inside, apart, rounded, own, max(rounded, own));
}

// Returns how far a point lies behind a depth along the view, metres.
fn gap_behind(p: InView, at: Point, depth: f32) -> f32 {
    return (depth * at.clip.y - at.clip.x) / (p.nearer.x - depth * p.nearer.y);
}

// What a camera knows of a point.
struct Look {
    gap: f32,    // how far behind a surface it is, metres; FLOAT_MAX: behind none
    hit: u32,    // that surface
    open: bool,  // nothing is there
    crossed: bool,  // the way to there leads through that surface
    past: bool,  // it lies behind the first layer, too, whose surface is another
}

fn look(p: InView, at: Point, depth: f32, source: u32) -> Look {
    let behind = at.inside && depth > at.least && (at.apart || source < FIRST_CAMERA);
    return Look(
        select(FLOAT_MAX, gap_behind(p, at, depth), behind), pack_hit(vec2u(at.pixel), source),
        at.inside && depth < at.depth, false, false);
}

// What a further camera showed of the point before, where a direction begins behind what that camera sees, as under a
// roof that is seen from above: what is behind is no matter then, until the direction comes out of it.
struct Under {
    is_under: bool,
    gap: f32,
    hit: u32,
}

// Returns where a direction begins for that: so far before its surface that another pixel shows it if it is seen
// edge-on, and that a ceiling seen from above is over it.
fn start_of(v: View, p: InView) -> Point {
    let width = 2.0 * length(v.up) / f32(v.size.y) * p.clip.w;
    return point_on(p, p.axes[2], APART * width);
}

fn start_under(at: Point, depth: f32, source: u32) -> Under {
    return Under(at.inside && depth > at.depth, FLOAT_MAX, pack_hit(vec2u(at.pixel), source));
}

// Returns what a further camera shows. `advance` and `reach` are as below.
fn look_from(
    p: InView, at: Point, depth: f32, source: u32, under: ptr<function, Under>, advance: f32, reach: f32
) -> Look {
    let now = look(p, at, depth, source);
    let behind = at.inside && depth > at.depth;
    // It comes out through the surface if it has gone as far as that was, else aside of its border.
    let through = at.inside && !behind && (*under).gap <= -advance;
    // It shows the far side then: what another camera shows comes first.
    let found = Look(select(FLOAT_MAX, reach, through), (*under).hit, !behind && now.open && !through, through, false);
    let was_under = (*under).is_under;
    // What the camera shows at the marcher's own place may be the top of its own wall.
    *under = Under(
        was_under && (behind || !at.apart), select(FLOAT_MAX, gap_behind(p, at, depth), at.apart), pack_hit(vec2u(at.pixel), source));
    return Look(
        select(now.gap, found.gap, was_under), select(now.hit, found.hit, was_under),
        select(now.open, found.open, was_under), was_under && through, false);
}

// Returns what the camera's layers show. `advance` is how much farther from the camera the point lies than the one
// before, metres.
fn look_at_layers(p: InView, at: Point, advance: f32) -> Look {
    let first = textureLoad(depth_0, at.pixel, 0);
    if (LAYERS == 1u) {
        return look(p, at, first, 0u);
    }
    // Of the surfaces before the point: is their number odd, which is the last, by which one did the way last go in,
    // which comes next, and are these all that is known?
    let second = textureLoad(depth_1, at.pixel, 0);
    let behind = at.inside && first > at.least;
    let past_second = second > at.least;
    var within = !past_second;
    var face = select(0u, 1u, past_second);
    var entry = first;
    var next = select(second, 0.0, past_second);
    var past_all = past_second;
    if (LAYERS > 2u) {
        let third = textureLoad(depth_2, at.pixel, 0);
        let past_third = third > at.least;
        within = within | past_third;
        face = select(face, 2u, past_third);
        entry = select(entry, third, past_third);
        next = select(select(next, third, past_second), 0.0, past_third);
        past_all = past_third;
        if (LAYERS > 3u) {
            let fourth = textureLoad(depth_3, at.pixel, 0);
            let past_fourth = fourth > at.least;
            within = within & !past_fourth;
            face = select(face, 3u, past_fourth);
            next = select(select(next, fourth, past_third), 0.0, past_fourth);
            past_all = past_fourth;
        }
    }
    let gap = gap_behind(p, at, entry);
    let ends = next > 0.0;
    // Since the point before, it may have gone in by one face and out by the other.
    let crossed = !within & (gap < advance);
    // Away from the camera directions go in by the front face, towards it by the back.
    face += select(0u, 1u, within & ends & (advance < 0.0));
    face -= select(0u, 1u, crossed);
    let claimed = behind & (within | crossed);
    let open = at.inside && !claimed && ((behind && !past_all) || first < at.depth);
    return Look(
        select(FLOAT_MAX, select(gap, 0.0, ends | crossed), claimed), pack_hit(vec2u(at.pixel), face), open, false,
        behind & (!claimed | (face > 0u)));
}

// Returns what two cameras know together.
fn together(a: Look, b: Look) -> Look {
    return Look(
        min(a.gap, b.gap), select(b.hit, a.hit, a.gap <= b.gap), a.open || b.open, a.crossed || b.crossed,
        a.past || b.past);
}
