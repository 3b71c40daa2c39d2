// Which surface a direction meets first, as far as the camera and further ones show it: the blocker test of
// screen-space occlusion (Ritschel et al. 2009, sections 3 and 4).
//
// A point is projected to its pixel and compared with the surface there; it lies in the open if that is farther away.
// What is behind a surface is taken for matter, however thick, unless another camera or layer shows that it is open:
// with two layers, matter reaches from the first to the second, with four also from the third to the fourth. Departure:
// several points along each direction, and the first that is hidden counts, so that what lies behind an occluder does
// not matter, and with ever more points every crossing is found.
#import "ssdo/look.wgsl"

override STEPS: u32 = 16u;  // points along each direction

// Of a step: a gap behind a surface no wider than the step to there is matter even where another camera looks into it,
// since points may step over a thin wall. Chosen: with 2 and 4 a courtyard comes out too dark.
const LEAST_THICKNESS: f32 = 1.0;

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
        var seen = look_at_layers(m.main, point_on(m.main, along, way), away * (way - before));
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
        last = before;
        before = way;
    }
    // Of the camera's nearest layer and the first further camera; others show less of what is near.
    if (found != NO_HIT && source_of_hit(found) == 0u) {
        return move_to_surface(depth_0, m.main, along, last, before, found);
    }
    if (CAMERAS > 0u && found != NO_HIT && source_of_hit(found) == FIRST_CAMERA) {
        return move_to_surface(depth_4, m.a, along_a, last, before, found);
    }
    return found;
}
