// The march along a slice: its sectors that surfaces cover, those that are free, and those that no picture decides.
//
// Therrien, Levesque and Gilet 2023, "Screen Space Indirect Lighting with Visibility Bitmask". Each tap covers the
// sectors from the front to the back of its surface; those that no nearer tap covers see it. Departures: sectors have
// equal shares of the measure, and their borders shift at random, so that few suffice; matter ends at the next depth
// layer, and nowhere with a single one; the surface that a newly covered arc sees is looked up where a random direction
// of the arc meets the line to the tap before; beyond the picture, taps continue in the wide camera at the same place.
// With KNOWN, an arc counts as covered if that surface lies in the arc, or a layer bounds the matter; the arc behind
// the edge of a surface is undecided. The importing pass defines `see(hit, direction, share)`, called for each arc.
// Errs blurry by the distance of taps; thin things between taps are missed.
#import "ssdo/slice_receiver.wgsl"
#import "ssdo/slice_taps.wgsl"
#import "common/matte.wgsl"

override TAPS: u32 = 8u;        // to each side, in the picture
override WIDE_TAPS: u32 = 0u;   // to each side, in the wide camera beyond the picture
override KNOWN: bool = false;   // tell covered sectors from undecided ones

const SECTORS: u32 = 32u;
// Thickness of matter whose far side no layer shows, in r_max.
const FAR: f32 = 100.0;
// The surface that an arc sees lies at least this share of the arc away from its ends.
const ARC_MARGIN: f32 = 0.05;

// A slice and its sectors: one bit each, from the negative horizon on.
struct March {
    slice: Slice,
    line: SliceLine,
    border: f32,     // shifts the sectors' borders
    covered: u32,    // or below the surface
    undecided: u32,  // behind a surface whose far side is unknown
}

// The last tap on the way outwards to one side.
struct Outwards {
    turn: f32,     // 1: the positive side, -1: the negative one
    edge: vec2f,   // unit vector to the surface nearest to the axis so far
    edge_share: f32,
    is_edge: bool, // the last tap shows it
    before: Shown,
    last: Shown,
}

// Returns the bits of the sectors between two shares of the slice's measure.
fn sectors_between(m: March, a: f32, b: f32) -> u32 {
    let ends = vec2u(vec2f(min(a, b), max(a, b)) * f32(SECTORS) + m.border);
    let below = select((vec2u(1u) << (ends & vec2u(31u))) - 1u, vec2u(0xffffffffu), ends >= vec2u(SECTORS));
    return below.y & ~below.x;
}

fn share_of(slice: Slice, point: vec2f) -> f32 {
    let unit = point * inverseSqrt(max(dot(point, point), 1e-30));
    return share_up_to(slice, unit.x, unit.y);
}

fn start_march(r: Receiver, numbers: SliceNumbers) -> March {
    let slice = slice_at(-r.ray.direction, r.normal, view.up, numbers.azimuth);
    let line = slice_line(slice, r.side, r.place);
    var m = March(slice, line, numbers.border, 0u, 0u);
    m.covered = ~sectors_between(m, share_of(slice, -line.horizon), share_of(slice, line.horizon));
    return m;
}

// Covers the free sectors between two shares of the measure: they see `hit`, in the direction `seen`, a unit vector of
// the slice. `decided`: it is a hit; else they become undecided.
fn cover_arc(m: ptr<function, March>, front: f32, back: f32, decided: bool, seen: vec2f, hit: u32) {
    let arc = sectors_between(*m, front, back);
    let bits = arc & ~((*m).covered | (*m).undecided);
    (*m).covered |= select(0u, bits, decided);
    (*m).undecided |= select(bits, 0u, decided);
    let share = select(0.0, f32(countOneBits(bits)) * (1.0 / f32(SECTORS)), decided);
    see(hit, seen.x * (*m).slice.axis + seen.y * (*m).slice.tangent, share);
}

// Covers the matter between the third and the fourth layer at a tap of the main view.
fn cover_behind(m: ptr<function, March>, radius: f32, v: SliceView, tap: Tap) {
    let third = shown_at(v, tap, textureLoad(depth_2, tap.pixel, 0));
    if (!third.is_known) {
        return;
    }
    var end = tap.start + (third.view_depth + FAR * radius) * tap.change;
    var is_closed = false;
    if (LAYERS > 3u) {
        let fourth = shown_at(v, tap, textureLoad(depth_3, tap.pixel, 0));
        is_closed = fourth.is_known;
        end = select(end, fourth.point, is_closed);
    }
    let near = normalize(third.point);
    let is_back = is_closed && near.x > 0.0;
    cover_arc(
        m, share_up_to((*m).slice, near.x, near.y), share_of((*m).slice, end), !KNOWN || is_closed,
        select(near, normalize(end), is_back), pack_hit(tap.pixel, select(2u, 3u, is_back)));
}

// Makes the arc undecided in which the surface nearest to the axis, of the last tap, may end before this tap, which
// lies below it or shows no surface.
fn end_edge(m: ptr<function, March>, o: ptr<function, Outwards>, tap: Tap, is_above: bool) {
    let most = normalize(continued((*o).before, (*o).last, tap));
    let ends = (*o).is_edge && !is_above && cross_2d(most, (*o).edge) * (*o).turn > 0.0;
    let arc = sectors_between(*m, share_up_to((*m).slice, most.x, most.y), (*o).edge_share);
    (*m).undecided |= select(0u, arc & ~(*m).covered, ends);
    (*o).is_edge = (*o).is_edge && is_above;
}

// Takes a tap at a distance along a line of a view, pixels of the main one. `place`: of the receiver in that view;
// `step`: per unit of distance; `number`: random, 0 to 1.
fn take_tap(
    m: ptr<function, March>, o: ptr<function, Outwards>, radius: f32, v: SliceView, depths: texture_depth_2d,
    source: u32, place: vec2f, step: vec2f, at: f32, number: f32
) {
    // Find the surface. It fades towards r_max: it counts with that probability.
    let tap = tap_at(v, place + step * at, at);
    var front = shown_at(v, tap, textureLoad(depths, tap.pixel, 0));
    // A pixel beside a surface seen edge-on may lie on the other side of the axis: turn it around, which keeps it on the
    // surface.
    front.point *= select(-1.0, 1.0, front.point.y * (*o).turn >= 0.0);
    let is_kept = front.is_known && distance_fade(radius, length(front.point)) > number;
    let near = normalize(front.point);
    let width = cross_2d(near, (*o).edge) * (*o).turn;
    let is_above = is_kept && width > 0.0;
    if (KNOWN) {
        end_edge(m, o, tap, is_above);
    }
    if (!is_kept) {
        return;
    }
    // Look up the surface in a random direction of the arc. It is the one that the arc sees if it lies within the arc.
    let across = crossing_at((*o).last, front, mix(near, (*o).edge, number));
    let middle_tap = tap_at(v, place + step * across, across);
    let middle = shown_at(v, middle_tap, textureLoad(depths, middle_tap.pixel, 0));
    let inner = normalize(middle.point);
    let from_ends = vec2f(cross_2d(near, inner), cross_2d(inner, (*o).edge)) * (*o).turn;
    let is_inner = middle.is_known && all(from_ends >= vec2f(ARC_MARGIN * width));
    // The arc ends at the surface nearest to the axis so far, or at the next layer, beyond which is free space.
    let share = share_up_to((*m).slice, near.x, near.y);
    var seen = select(near, inner, is_inner);
    var end = (*o).edge_share;
    var is_bounded = false;
    var is_back = false;
    if (LAYERS > 1u && source == 0u) {
        let second = shown_at(v, tap, textureLoad(depth_1, tap.pixel, 0));
        is_bounded = second.is_known && !is_inner;
        let far = tap.start + (front.view_depth + FAR * radius) * tap.change;
        let back = select(far, second.point, is_bounded);
        end = select(end, share_of((*m).slice, back), is_bounded || width <= 0.0);
        // Directions towards the eye meet the far side.
        is_back = is_bounded && near.x > 0.0;
        seen = select(seen, normalize(back), is_back);
    }
    // Cover the arc, if what it sees is known. A shiny surface sends other light to the receiver than to the camera.
    let pixel = select(tap.pixel, middle_tap.pixel, is_inner);
    var is_decided = !KNOWN || is_inner || is_bounded;
    if (KNOWN && HAS_COATS && source == 0u) {
        is_decided = is_decided && is_matte_brdf(gbuffer_brdf(load_surface(pixel)));
    }
    cover_arc(m, share, end, is_decided, seen, pack_hit(pixel, select(source, 1u, is_back)));
    if (LAYERS > 2u && source == 0u) {
        cover_behind(m, radius, v, tap);
    }
    // Go on from here.
    (*o).edge = select((*o).edge, near, is_above);
    (*o).edge_share = select((*o).edge_share, share, is_above);
    (*o).is_edge = is_above;
    (*o).before = (*o).last;
    if (is_inner) {
        (*o).before = middle;
    }
    (*o).last = front;
}

// Returns the share up to which directions to one side leave the scene within the view that ends the march: they meet
// its border beyond a sphere around the scene. `at`: distance of that border; the rest as in take_tap().
fn free_from(m: March, v: SliceView, view_there: View, place: vec2f, step: vec2f, at: f32) -> f32 {
    let size = vec2f(view.size);
    let end = clamp(place + step * at, vec2f(0.0), size - 1e-3);
    let tap = tap_at(v, end, at);
    // Where the border's ray leaves the sphere.
    let ndc = (floor(end) + view.offset) / size * vec2f(2.0, -2.0) + vec2f(-1.0, 1.0);
    let aside = ndc.x * view_there.right + ndc.y * view_there.up;
    let parallel = view.orthographic != 0u;
    let way = view_there.forward + select(aside, vec3f(0.0), parallel);
    let from_centre = view_there.position + select(vec3f(0.0), aside, parallel) - scene.centre;
    let a = dot(way, way);
    let b = dot(from_centre, way);
    let discriminant = b * b - a * (dot(from_centre, from_centre) - scene.radius * scene.radius);
    let exit = select(0.0, max(sqrt(max(discriminant, 0.0)) - b, 0.0) / a, discriminant > 0.0);
    return share_of(m.slice, tap.start + exit * tap.change);
}

// Marches along a slice to both sides. In the result, sectors that no surface covers and that do not leave the scene
// within the pictures are undecided.
fn march_slice(r: Receiver, numbers: SliceNumbers) -> March {
    var m = start_march(r, numbers);
    let picture = slice_view(m.line, r.position, view);
    let wide = slice_view(m.line, r.position, view_1);
    let centre = 0.5 * vec2f(view.size);
    let widening = length(view.up) / length(view_1.up);
    let wide_place = centre + (r.place - centre) * widening;
    let depth = r.seen * dot(r.ray.direction, view.forward);
    let most = pixels_of_radius(r.radius, depth);
    var free = 0u;
    for (var k = 0u; k < 2u; k += 1u) {
        let turn = select(-1.0, 1.0, k == 0u);
        let step = turn * m.line.step;
        let number = fract(numbers.place + select(0.0, 0.5, k == 1u));
        // Surfaces at the picture's border fade: the march ends short of it, by a random distance.
        let short = BORDER_FADE * f32(view.size.y) * numbers.further;
        let whole = steps_to_border(r.place, step) - select(short, 0.0, WIDE_TAPS > 0u);
        let reach = max(min(whole, most), FIRST_TAP);
        let own = Shown(vec2f(0.0), depth, 0.0, true);
        let edge = turn * m.line.horizon;
        var o = Outwards(turn, edge, share_of(m.slice, edge), false, own, own);
        for (var j = 0u; j < TAPS; j += 1u) {
            let share = min((f32(j) + number) / f32(max(TAPS, 2u) - 1u), 1.0);
            let at = FIRST_TAP + (reach - FIRST_TAP) * share * sqrt(share);
            let own_number = fract(numbers.border + GOLDEN * f32(j));
            take_tap(&m, &o, r.radius, picture, depth_0, 0u, r.place, step, at, own_number);
        }
        if (WIDE_TAPS == 0u) {
            if (KNOWN) {
                let share = free_from(m, picture, view, r.place, step, reach);
                free |= sectors_between(m, share, select(0.0, 1.0, k == 0u));
            }
        } else {
            let wide_step = step * widening;
            let wide_reach = max(min(steps_to_border(wide_place, wide_step) - short / widening, most), reach);
            for (var j = 0u; j < WIDE_TAPS; j += 1u) {
                let share = (f32(j) + 1.0 - number) / f32(WIDE_TAPS);
                let at = reach * pow(wide_reach / reach, share);
                take_tap(
                    &m, &o, r.radius, wide, depth_4, FIRST_CAMERA, wide_place, wide_step, at,
                    fract(numbers.border + GOLDEN * f32(j)));
            }
            if (KNOWN) {
                let share = free_from(m, wide, view_1, wide_place, wide_step, wide_reach);
                free |= sectors_between(m, share, select(0.0, 1.0, k == 0u));
            }
        }
    }
    if (KNOWN) {
        m.undecided |= ~(m.covered | free);
    }
    return m;
}
