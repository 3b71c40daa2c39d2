// Which surface a direction meets first, as far as the camera and further ones show it: the blocker test of
// screen-space occlusion (Ritschel et al. 2009, sections 3 and 4).
//
// A point is projected to its pixel and compared with the surface there; it lies in the open if that is farther away.
// What is behind a surface is taken for matter, however thick, unless another camera or layer shows that it is open:
// with two layers, matter reaches from the first to the second, with four also from the third to the fourth; what lies
// behind the last is taken for open, unless another camera shows that it is not.
// Departure: several points along each direction, and the first that is hidden counts, so that what lies behind an
// occluder does not matter, and with ever more points every crossing is found.
#import "ssdo/look.wgsl"

override STEPS: u32 = 16u;  // points along each direction

// Of a step: a gap behind a surface no wider than the step to there is matter even where another camera looks into it,
// since points may step over a thin wall. Chosen: with 2 and 4 a courtyard comes out too dark.
const LEAST_THICKNESS: f32 = 1.0;
// Behind a wall seen at a grazing angle, gaps are much wider than the step, and behind the last layer nothing is known:
// such a wall is found by its plane. Depth goes on evenly there from pixel to pixel, but for this share of its change,
const UNEVEN: f32 = 0.5;
// and what lies off it by no more than it changes within so many pixels is the same wall. Chosen.
const OFF_PLANE: f32 = 1.0;

struct Marcher {
    reach: f32,      // r_max, metres
    forward: vec3f,  // of the camera, in the frame
    forward_b: vec3f,  // of the second further camera and those after it
    forward_c: vec3f,
    forward_d: vec3f,
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
        m.forward_b = view_2.forward * frame;
    }
    if (CAMERAS > 2u) {
        m.c = in_view(view_3, position, frame, tangents);
        m.forward_c = view_3.forward * frame;
    }
    if (CAMERAS > 3u) {
        m.d = in_view(view_4, position, frame, tangents);
        m.forward_d = view_4.forward * frame;
    }
    return m;
}

// Returns a hit found between two points of a direction moved to where it meets the surface, if both ends tell (regula
// falsi) and a pixel nearer to the direction is there.
fn move_to_surface(
    shown: texture_depth_2d, p: InView, along: vec4f, before: f32, way: f32, hit: u32
) -> u32 {
    let first = point_on(p, along, before);
    let last = point_on(p, along, way);
    let ahead = gap_behind(p, first, textureLoad(shown, first.pixel, 0));
    let behind = gap_behind(p, last, textureLoad(shown, last.pixel, 0));
    let met = point_on(p, along, mix(before, way, saturate(ahead / min(ahead - behind, -1e-30))));
    let depth = textureLoad(shown, met.pixel, 0);
    let better = first.inside && met.inside && ahead < 0.0 && depth > met.own
        && abs(gap_behind(p, met, depth)) < behind;
    return select(hit, pack_hit(vec2u(met.pixel), source_of_hit(hit)), better);
}

fn depth_at(shown: texture_depth_2d, pixel: vec2i) -> f32 {
    let inside = clamp(pixel, vec2i(0), vec2i(textureDimensions(shown)) - 1);
    return select(0.0, textureLoad(shown, inside, 0), all(inside == pixel));
}

// Returns how the depth that a pixel shows changes to the `next`, by the side where it goes on more evenly, and how
// unevenly it does there.
fn slope_at(shown: texture_depth_2d, pixel: vec2i, next: vec2i) -> vec2f {
    let depth = depth_at(shown, pixel);
    let ahead = depth_at(shown, pixel + next);
    let behind = depth_at(shown, pixel - next);
    let on = vec2f(ahead - depth, abs(depth_at(shown, pixel + 2 * next) - 2.0 * ahead + depth));
    let back = vec2f(depth - behind, abs(depth_at(shown, pixel - 2 * next) - 2.0 * behind + depth));
    return select(back, on, on.y < back.y);
}

// Returns where a direction led through the surface that it lies behind at the end of `way`: there it meets the
// surface's plane, and the pixel shows that plane. NO_HIT if it came past its border, or if what the hit's pixel shows
// is too narrow to tell its plane.
fn led_through(shown: texture_depth_2d, p: InView, along: vec4f, way: f32, hit: u32) -> u32 {
    let pixel = vec2i(pixel_of_hit(hit));
    let centre = vec2f(pixel) + 0.5;
    let depth = depth_at(shown, pixel);
    let across = slope_at(shown, pixel, vec2i(1, 0));
    let down = slope_at(shown, pixel, vec2i(0, 1));
    let slope = vec2f(across.x, down.x);
    let rounding = PLANE_ROUNDING * (dot(abs(slope), p.size) + depth);
    let is_plane = all(vec2f(across.y, down.y) <= UNEVEN * abs(slope) + rounding);
    // Over the picture depths of planes are linear, and so is the way in clip space: find where both meet.
    let plane = vec4f(-slope, 1.0, dot(slope, centre) - depth);
    let before = dot(plane, p.clip);
    let share = before / max(before - dot(plane, p.clip + way * along), 1e-30);
    let clip = p.clip + saturate(share) * way * along;
    let place = clip.xy / clip.w;
    let inside = clip.w > 0.0 && all(place >= vec2f(0.0)) && all(place < p.size);
    let met = floor(select(centre, place, inside));
    let off = abs(depth_at(shown, vec2i(met)) - depth - dot(slope, met + 0.5 - centre));
    let shows_plane = off <= OFF_PLANE * (abs(slope.x) + abs(slope.y)) + rounding;
    let through = is_plane && inside && before >= 0.0 && shows_plane;
    return select(NO_HIT, pack_hit(vec2u(met), source_of_hit(hit)), through);
}

// Returns the first surface that a point along a direction of the marcher's frame lies behind, or NO_HIT. Points come
// with the power 2.5 of their number, since what is near hides more; `shift` in 0 to 1 moves them along.
fn march(m: Marcher, direction: vec3f, shift: f32) -> u32 {
    let along = m.main.axes * direction;
    let along_a = m.a.axes * direction;
    let along_b = m.b.axes * direction;
    let along_c = m.c.axes * direction;
    let along_d = m.d.axes * direction;
    let away = dot(m.forward, direction);
    var found = NO_HIT;
    // The first surfaces that a point lies behind, but another camera or layer looks in: did it come there past their
    // borders?
    // Asked after all steps, by values carried over: where a condition is computed from uniforms and more at once,
    // lavapipe (Mesa 22.3.6) writes beyond its memory as it follows it.
    var asked = NO_HIT;
    var asked_a = NO_HIT;
    var asked_way = 0.0;
    var asked_way_a = 0.0;
    var before = 0.0;
    var last = 0.0;
    var under_b: Under;
    var under_c: Under;
    var under_d: Under;
    if (CAMERAS > 1u) {
        let at = start_of(view_2, m.b);
        under_b = start_under(at, textureLoad(depth_5, at.pixel, 0), 5u);
    }
    if (CAMERAS > 2u) {
        let at = start_of(view_3, m.c);
        under_c = start_under(at, textureLoad(depth_6, at.pixel, 0), 6u);
    }
    if (CAMERAS > 3u) {
        let at = start_of(view_4, m.d);
        under_d = start_under(at, textureLoad(depth_7, at.pixel, 0), 7u);
    }
    for (var k = 0u; k < STEPS && found == NO_HIT; k += 1u) {
        let share = (f32(k) + shift) * (1.0 / f32(STEPS));
        let way = m.reach * share * share * sqrt(share);
        let point = point_on(m.main, along, way);
        var seen = look_at_layers(m.main, point, away * (way - before));
        if (CAMERAS > 0u) {
            let at = point_on(m.a, along_a, way);
            seen = together(seen, look(m.a, at, textureLoad(depth_4, at.pixel, 0), 4u));
        }
        if (CAMERAS > 1u) {
            let at = point_on(m.b, along_b, way);
            let depth = textureLoad(depth_5, at.pixel, 0);
            let advance = dot(m.forward_b, direction) * (way - before);
            seen = together(seen, look_from(m.b, at, depth, 5u, &under_b, advance, m.reach));
        }
        if (CAMERAS > 2u) {
            let at = point_on(m.c, along_c, way);
            let depth = textureLoad(depth_6, at.pixel, 0);
            let advance = dot(m.forward_c, direction) * (way - before);
            seen = together(seen, look_from(m.c, at, depth, 6u, &under_c, advance, m.reach));
        }
        if (CAMERAS > 3u) {
            let at = point_on(m.d, along_d, way);
            let depth = textureLoad(depth_7, at.pixel, 0);
            let advance = dot(m.forward_d, direction) * (way - before);
            seen = together(seen, look_from(m.d, at, depth, 7u, &under_d, advance, m.reach));
        }
        let is_matter = seen.crossed || seen.gap <= LEAST_THICKNESS * (way - before)
            || (seen.gap <= m.reach && !seen.open);
        found = select(found, seen.hit, is_matter);
        let is_asked = seen.gap <= m.reach && !is_matter;
        let source = source_of_hit(seen.hit);
        let is_first = ((is_asked && source == 0u) || seen.past) && asked == NO_HIT;
        asked = select(asked, pack_hit(vec2u(point.pixel), 0u), is_first);
        asked_way = select(asked_way, way, is_first);
        let is_first_a = is_asked && asked_a == NO_HIT && source == FIRST_CAMERA;
        asked_a = select(asked_a, seen.hit, is_first_a);
        asked_way_a = select(asked_way_a, way, is_first_a);
        last = before;
        before = way;
    }
    // Of the camera's nearest layer and the first further camera; others show less of what is near.
    var through = NO_HIT;
    if (CAMERAS > 0u && asked_a != NO_HIT) {
        through = led_through(depth_4, m.a, along_a, asked_way_a, asked_a);
    }
    if ((CAMERAS > 0u || LAYERS > 1u) && asked != NO_HIT && through == NO_HIT) {
        through = led_through(depth_0, m.main, along, asked_way, asked);
    }
    if (through != NO_HIT) {
        return through;
    }
    if (found != NO_HIT && source_of_hit(found) == 0u) {
        return move_to_surface(depth_0, m.main, along, last, before, found);
    }
    if (CAMERAS > 0u && found != NO_HIT && source_of_hit(found) == FIRST_CAMERA) {
        return move_to_surface(depth_4, m.a, along_a, last, before, found);
    }
    return found;
}
