// Which surface a direction meets first, as far as the camera and further ones show it: the blocker test of
// screen-space occlusion (Ritschel et al. 2009, sections 3 and 4).
//
// A point is projected to its pixel and compared with the surface there; it lies in the open if that is farther away.
// What is behind a surface is taken for matter, however thick, unless another camera or layer shows that it is open:
// with two layers, matter reaches from the first to the second, with four also from the third to the fourth. Departure:
// several points along each direction, and the first that is hidden counts, so that what lies behind an occluder does
// not matter, and with ever more points every crossing is found.
#import "ssdo/hits.wgsl"

override STEPS: u32 = 16u;  // points along each direction

// Rounding of float32 in the projection and of the interpolation by rasterisation, of the depth. Chosen.
const RASTER_ROUNDING: f32 = 4e-6;
// Likewise of the plane through a surface, of the terms that it is the sum of. Chosen.
const PLANE_ROUNDING: f32 = 1e-5;
// A gap behind a surface as wide as the way to there is matter even where another camera looks into it: points may
// step over a thin wall. Chosen; with 0.5 and with 2, errors on a courtyard, in the Cornell box and in Sponza are alike.
const LEAST_THICKNESS: f32 = 1.0;

// Pixels of a further camera, which may see the marcher's surface edge-on or not at all: nearer to it, a pixel shows
// what lies beside. Chosen.
const APART: f32 = 1.5;

// A point on a surface, the axes of its directions and its tangent plane, as a camera projects them.
struct InView {
    clip: vec4f,
    axes: mat3x4f,
    plane: vec3f,   // depth of the tangent plane: x place.x + y place.y + z, in pixels
    place: vec2f,   // of the point, pixels
    nearer: vec2f,  // what z and w of clip space change by for a metre towards the camera
}

fn place_of(v: View, clip: vec4f) -> vec2f {
    return (clip.xy / clip.w * vec2f(0.5, -0.5) + 0.5) * vec2f(v.size);
}

// `frame` holds the axes of directions, the first two of `tangents` span the surface itself.
fn in_view(v: View, position: vec3f, frame: mat3x3f, tangents: mat3x3f) -> InView {
    let m = v.clip_from_world;
    let clip = m * vec4f(position, 1.0);
    let axes = mat3x4f(m * vec4f(frame[0], 0.0), m * vec4f(frame[1], 0.0), m * vec4f(frame[2], 0.0));
    // How place and depth change along the plane: derivatives of a projective map.
    let ndc = clip.xyz / clip.w;
    let a4 = m * vec4f(tangents[0], 0.0);
    let b4 = m * vec4f(tangents[1], 0.0);
    let to_pixels = vec3f(0.5 * f32(v.size.x), -0.5 * f32(v.size.y), 1.0);
    let a = (a4.xyz - ndc * a4.w) * to_pixels;
    let b = (b4.xyz - ndc * b4.w) * to_pixels;
    let slope = vec2f(a.z * b.y - b.z * a.y, b.z * a.x - a.z * b.x) / (a.x * b.y - a.y * b.x);
    // A plane seen edge-on covers no pixels; written so that a NaN fails.
    let known = all(abs(slope) < vec2f(1e30)) && clip.w > 0.0;
    let place = place_of(v, clip);
    let at = ndc.z - dot(slope, place);
    return InView(clip, axes, select(vec3f(0.0), vec3f(slope, at), known), place, -(m * vec4f(v.forward, 0.0)).zw);
}

// A point on the way along a direction, as a camera sees it.
struct Point {
    clip: vec2f,   // z and w
    pixel: vec2u,
    inside: bool,  // of the picture
    apart: bool,   // from the marcher's own place, so that its pixels do not show both
    depth: f32,    // that of the point, with rounding
    least: f32,    // of what lies before the point and is not the marcher's own surface
}

fn point_on(v: View, p: InView, along: vec4f, way: f32) -> Point {
    let clip = p.clip + way * along;
    let place = place_of(v, clip);
    let inside = clip.w > 0.0 && all(place >= vec2f(0.0)) && all(place < vec2f(v.size));
    let pixel = vec2u(select(vec2f(0.0), place, inside));
    let parallel = v.orthographic != 0u;
    let depth = clip.z / clip.w;
    let centre = vec3f(vec2f(pixel) + 0.5, 1.0);
    let own = dot(p.plane, centre) + PLANE_ROUNDING * dot(abs(p.plane), centre);
    let rounded = depth + RASTER_ROUNDING * select(depth, 1.0, parallel);
    let apart = max(abs(place.x - p.place.x), abs(place.y - p.place.y)) > APART;
    return Point(clip.zw, pixel, inside, apart, rounded, max(rounded, own));
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
}

fn look(p: InView, at: Point, depth: f32, source: u32) -> Look {
    let behind = at.inside && depth > at.least && (at.apart || source < FIRST_CAMERA);
    return Look(
        select(FLOAT_MAX, gap_behind(p, at, depth), behind), pack_hit(at.pixel, source),
        at.inside && depth < at.depth);
}

// Returns what the camera's layers show. `advance` is how much farther from the camera the point lies than the one
// before, metres.
fn look_at_layers(p: InView, at: Point, advance: f32) -> Look {
    var depths = vec4f(textureLoad(depth_0, at.pixel, 0), 0.0, 0.0, 0.0);
    if (LAYERS == 1u) {
        return look(p, at, depths.x, 0u);
    }
    depths.y = textureLoad(depth_1, at.pixel, 0);
    if (LAYERS > 2u) {
        depths.z = textureLoad(depth_2, at.pixel, 0);
    }
    if (LAYERS > 3u) {
        depths.w = textureLoad(depth_3, at.pixel, 0);
    }
    // How many surfaces lie before the point, the last of them and the next one.
    let before = depths > vec4f(at.least);
    let count = dot(vec4f(1.0), select(vec4f(0.0), vec4f(1.0), before));
    let last = select(select(select(depths.x, depths.y, before.y), depths.z, before.z), depths.w, before.w);
    let next = select(select(select(depths.y, depths.z, before.y), depths.w, before.z), 0.0, before.w);
    let within = (count == 1.0) | (count == 3.0);
    let ends = next > 0.0;
    // Since the point before, it may have gone in by one face and out by the other.
    let entered = select(depths.x, depths.z, count == 4.0);
    let crossed = !within && before.x && gap_behind(p, at, entered) < advance;
    let claimed = at.inside && before.x && (within || crossed);
    // Away from the camera directions go in by the front face, towards it by the back.
    let face = select(select(count - 1.0, count, ends && advance < 0.0), count - 2.0, crossed);
    let gap = select(gap_behind(p, at, last), 0.0, ends || crossed);
    return Look(
        select(FLOAT_MAX, gap, claimed), pack_hit(at.pixel, u32(max(face, 0.0))),
        at.inside && !claimed && (before.x || depths.x < at.depth));
}

// Returns what two cameras know together.
fn together(a: Look, b: Look) -> Look {
    return Look(min(a.gap, b.gap), select(b.hit, a.hit, a.gap <= b.gap), a.open || b.open);
}

struct Marcher {
    reach: f32,      // r_max, metres
    forward: vec3f,  // of the camera, in the frame
    main: InView,
    a: InView,
    b: InView,
    c: InView,
    d: InView,
}

fn marcher(position: vec3f, frame: mat3x3f, tangents: mat3x3f, reach: f32) -> Marcher {
    var m: Marcher;
    m.reach = reach;
    m.forward = view_0.forward * frame;
    m.main = in_view(view_0, position, frame, tangents);
    if (CAMERAS > 0u) {
        m.a = in_view(view_1, position, frame, tangents);
    }
    if (CAMERAS > 1u) {
        m.b = in_view(view_2, position, frame, tangents);
    }
    if (CAMERAS > 2u) {
        m.c = in_view(view_3, position, frame, tangents);
    }
    if (CAMERAS > 3u) {
        m.d = in_view(view_4, position, frame, tangents);
    }
    return m;
}

// Returns the first surface that a point along a direction of the marcher's frame lies behind, or NO_HIT. Points come
// with the square of their number, since what is near hides more; `shift` in 0 to 1 moves them along.
fn march(m: Marcher, direction: vec3f, shift: f32) -> u32 {
    let along = m.main.axes * direction;
    let along_a = m.a.axes * direction;
    let along_b = m.b.axes * direction;
    let along_c = m.c.axes * direction;
    let along_d = m.d.axes * direction;
    let away = dot(m.forward, direction);
    var found = NO_HIT;
    var before = 0.0;
    for (var k = 0u; k < STEPS; k += 1u) {
        let share = (f32(k) + shift) * (1.0 / f32(STEPS));
        let way = m.reach * share * share;
        var seen = look_at_layers(m.main, point_on(view_0, m.main, along, way), away * (way - before));
        if (CAMERAS > 0u) {
            let at = point_on(view_1, m.a, along_a, way);
            seen = together(seen, look(m.a, at, textureLoad(depth_4, at.pixel, 0), 4u));
        }
        if (CAMERAS > 1u) {
            let at = point_on(view_2, m.b, along_b, way);
            seen = together(seen, look(m.b, at, textureLoad(depth_5, at.pixel, 0), 5u));
        }
        if (CAMERAS > 2u) {
            let at = point_on(view_3, m.c, along_c, way);
            seen = together(seen, look(m.c, at, textureLoad(depth_6, at.pixel, 0), 6u));
        }
        if (CAMERAS > 3u) {
            let at = point_on(view_4, m.d, along_d, way);
            seen = together(seen, look(m.d, at, textureLoad(depth_7, at.pixel, 0), 7u));
        }
        let is_matter = seen.gap <= LEAST_THICKNESS * way || (seen.gap <= m.reach && !seen.open);
        found = select(found, seen.hit, is_matter && found == NO_HIT);
        before = way;
    }
    return found;
}
