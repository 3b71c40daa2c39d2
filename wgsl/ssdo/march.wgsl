// Screen-space ray marching: the first surface that a direction hits, as far as layers and cameras show it (the blocker
// test of Ritschel et al. 2009, sections 3 and 4).
//
// Points along the direction are projected and compared with the depth at their pixel. A point behind a surface counts
// as inside matter of any thickness, unless another camera or layer shows it in free space: two layers bound matter
// between the first and the second, four also between the third and the fourth. Behind the last layer a point counts as
// in free space. Departure: each direction has several points, and the first hidden one counts, so geometry behind the
// occluder does not matter; with enough points, every crossing is found. Errs bright where no view shows the
// occluder, dark behind occluders thinner than assumed.
#import "ssdo/depth_test.wgsl"

// Points along each direction. This is an override, like DIRECTIONS of `ssdo/search.wgsl`, not a param: lavapipe
// recompiles loops up to a uniform for each dispatch, and Mesa 22.3.6 writes out of bounds if a loop's end depends on
// both a uniform and values of the thread.
override STEPS: u32 = 16u;

// Least thickness of matter, in steps: a point behind a surface by no more than the last step is inside matter even if
// another camera shows it in free space, since steps may leap over a thin wall. Values of 2 and 4 make a courtyard too
// dark. tools/README.md, "Constants".
const LEAST_THICKNESS: f32 = 1.0;
// A wall seen at a grazing angle is found by its plane, because points come out far behind it. Pixels show one plane if
// their depth's change varies by at most this share; tools/README.md, "Constants".
const UNEVENNESS: f32 = 0.5;
// A pixel shows the same plane if its depth is off by at most the plane's change over this number of pixels;
// tools/README.md, "Constants".
const OFF_PLANE: f32 = 1.0;

// A receiver in the main view and in up to four further ones.
struct Marcher {
    radius: f32,       // r_max, metres
    forward: vec3f,    // of the main camera, in the frame of directions
    forward_b: vec3f,  // of further cameras, from the second on
    forward_c: vec3f,
    forward_d: vec3f,
    main: ReceiverInView,
    a: ReceiverInView,
    b: ReceiverInView,
    c: ReceiverInView,
    d: ReceiverInView,
}

fn marcher(position: vec3f, frame: mat3x3f, tangents: mat3x3f, radius: f32) -> Marcher {
    var m: Marcher;
    m.radius = radius;
    m.forward = view_0.forward * frame;
    m.main = receiver_in_view(view_0, position, frame, tangents);
    if (CAMERAS > 0u) {
        m.a = receiver_in_view(view_1, position, frame, tangents);
    }
    if (CAMERAS > 1u) {
        m.b = receiver_in_view(view_2, position, frame, tangents);
        m.forward_b = view_2.forward * frame;
    }
    if (CAMERAS > 2u) {
        m.c = receiver_in_view(view_3, position, frame, tangents);
        m.forward_c = view_3.forward * frame;
    }
    if (CAMERAS > 3u) {
        m.d = receiver_in_view(view_4, position, frame, tangents);
        m.forward_d = view_4.forward * frame;
    }
    return m;
}

// Moves a hit between the points at `start` and `end` metres to the crossing of direction and surface, by one step of
// regula falsi on the distance behind the surface. Returns the hit unchanged if that pixel shows no nearer surface.
fn refine_hit(depths: texture_depth_2d, r: ReceiverInView, along: vec4f, start: f32, end: f32, hit: u32) -> u32 {
    let first = project_point(r, along, start);
    let last = project_point(r, along, end);
    let behind_first = distance_behind(r, first, textureLoad(depths, first.pixel, 0));
    let behind_last = distance_behind(r, last, textureLoad(depths, last.pixel, 0));
    let share = saturate(behind_first / min(behind_first - behind_last, -1e-30));
    let crossing = project_point(r, along, mix(start, end, share));
    let depth = textureLoad(depths, crossing.pixel, 0);
    let is_nearer = first.is_inside && crossing.is_inside && behind_first < 0.0 && depth > crossing.plane_depth
        && abs(distance_behind(r, crossing, depth)) < behind_last;
    return select(hit, pack_hit(vec2u(crossing.pixel), hit_source(hit)), is_nearer);
}

// Returns the depth at a pixel, 0 outside the picture.
fn depth_at(depths: texture_depth_2d, pixel: vec2i) -> f32 {
    let clamped = clamp(pixel, vec2i(0), vec2i(textureDimensions(depths)) - 1);
    return select(0.0, textureLoad(depths, clamped, 0), all(clamped == pixel));
}

// Returns the change of depth from a pixel to the one at `step`, and its second difference, on the side where depths
// change more evenly: that side shows the same surface.
fn depth_slope(depths: texture_depth_2d, pixel: vec2i, step: vec2i) -> vec2f {
    let depth = depth_at(depths, pixel);
    let ahead = depth_at(depths, pixel + step);
    let back = depth_at(depths, pixel - step);
    let forward = vec2f(ahead - depth, abs(depth_at(depths, pixel + 2 * step) - 2.0 * ahead + depth));
    let backward = vec2f(depth - back, abs(depth_at(depths, pixel - 2 * step) - 2.0 * back + depth));
    return select(backward, forward, forward.y < backward.y);
}

// Returns the hit on the surface in front of the point at `t`, if the direction crosses its plane before `t` and the
// pixel there shows the same plane. Returns NO_HIT if the direction passed the surface's border, or if the surface is
// too narrow to tell its plane.
fn plane_crossing(depths: texture_depth_2d, r: ReceiverInView, along: vec4f, t: f32, hit: u32) -> u32 {
    // Find the plane, from differences of depth.
    let pixel = vec2i(hit_pixel(hit));
    let centre = vec2f(pixel) + 0.5;
    let depth = depth_at(depths, pixel);
    let across = depth_slope(depths, pixel, vec2i(1, 0));
    let down = depth_slope(depths, pixel, vec2i(0, 1));
    let slope = vec2f(across.x, down.x);
    let rounding = PLANE_ROUNDING * (dot(abs(slope), r.size) + depth);
    let is_plane = all(vec2f(across.y, down.y) <= UNEVENNESS * abs(slope) + rounding);
    // Intersect the plane, whose depth is linear over the picture, with the direction, which is linear in clip space.
    let plane = vec4f(-slope, 1.0, dot(slope, centre) - depth);
    let in_front = dot(plane, r.clip);
    let share = in_front / max(in_front - dot(plane, r.clip + t * along), 1e-30);
    let clip = r.clip + saturate(share) * t * along;
    let place = clip.xy / clip.w;
    let is_inside = clip.w > 0.0 && all(place >= vec2f(0.0)) && all(place < r.size);
    let crossing = floor(select(centre, place, is_inside));
    // Test whether the pixel at the crossing shows that plane.
    let off = abs(depth_at(depths, vec2i(crossing)) - depth - dot(slope, crossing + 0.5 - centre));
    let shows_plane = off <= OFF_PLANE * (abs(slope.x) + abs(slope.y)) + rounding;
    let is_crossed = is_plane && is_inside && in_front >= 0.0 && shows_plane;
    return select(NO_HIT, pack_hit(vec2u(crossing), hit_source(hit)), is_crossed);
}

// Returns the first surface that hides a point along a direction of the receiver's frame, or NO_HIT. The distance of
// points grows with the power 2.5 of their number, since near occluders hide more; `jitter`, 0 to 1, shifts them.
fn march(m: Marcher, direction: vec3f, jitter: f32) -> u32 {
    let along = m.main.axes * direction;
    let along_a = m.a.axes * direction;
    let along_b = m.b.axes * direction;
    let along_c = m.c.axes * direction;
    let along_d = m.d.axes * direction;
    let away = dot(m.forward, direction);
    var found = NO_HIT;
    // Doubtful surfaces: the first ones, of the main layer and of the first further camera, that hide a point which
    // another view shows in free space. The direction crossed them or passed their border. The test runs after the
    // loop, on values carried over, for the reason given at STEPS.
    var doubtful = NO_HIT;
    var doubtful_a = NO_HIT;
    var doubtful_t = 0.0;
    var doubtful_t_a = 0.0;
    var t = 0.0;
    var previous_t = 0.0;
    // Further cameras that see a cover over the receiver.
    var cover_b: Cover;
    var cover_c: Cover;
    var cover_d: Cover;
    if (CAMERAS > 1u) {
        let point = cover_point(view_2, m.b);
        cover_b = start_cover(point, textureLoad(depth_5, point.pixel, 0), 5u);
    }
    if (CAMERAS > 2u) {
        let point = cover_point(view_3, m.c);
        cover_c = start_cover(point, textureLoad(depth_6, point.pixel, 0), 6u);
    }
    if (CAMERAS > 3u) {
        let point = cover_point(view_4, m.d);
        cover_d = start_cover(point, textureLoad(depth_7, point.pixel, 0), 7u);
    }
    for (var k = 0u; k < STEPS && found == NO_HIT; k += 1u) {
        let share = (f32(k) + jitter) * (1.0 / f32(STEPS));
        let next_t = m.radius * share * share * sqrt(share);
        let step = next_t - t;
        // Combine the tests of all views.
        let main_point = project_point(m.main, along, next_t);
        var test = test_layers(m.main, main_point, away * step);
        if (CAMERAS > 0u) {
            let point = project_point(m.a, along_a, next_t);
            test = combine_tests(test, test_depth(m.a, point, textureLoad(depth_4, point.pixel, 0), 4u));
        }
        if (CAMERAS > 1u) {
            let point = project_point(m.b, along_b, next_t);
            let depth = textureLoad(depth_5, point.pixel, 0);
            let advance = dot(m.forward_b, direction) * step;
            test = combine_tests(test, test_further_camera(m.b, point, depth, 5u, &cover_b, advance, m.radius));
        }
        if (CAMERAS > 2u) {
            let point = project_point(m.c, along_c, next_t);
            let depth = textureLoad(depth_6, point.pixel, 0);
            let advance = dot(m.forward_c, direction) * step;
            test = combine_tests(test, test_further_camera(m.c, point, depth, 6u, &cover_c, advance, m.radius));
        }
        if (CAMERAS > 3u) {
            let point = project_point(m.d, along_d, next_t);
            let depth = textureLoad(depth_7, point.pixel, 0);
            let advance = dot(m.forward_d, direction) * step;
            test = combine_tests(test, test_further_camera(m.d, point, depth, 7u, &cover_d, advance, m.radius));
        }
        // Record whether the point is inside matter, or a surface in front of it is doubtful.
        let is_matter = test.is_crossed || test.behind <= LEAST_THICKNESS * step
            || (test.behind <= m.radius && !test.is_open);
        found = select(found, test.hit, is_matter);
        let is_doubtful = test.behind <= m.radius && !is_matter;
        let source = hit_source(test.hit);
        let is_first = ((is_doubtful && source == 0u) || test.is_past_first) && doubtful == NO_HIT;
        doubtful = select(doubtful, pack_hit(vec2u(main_point.pixel), 0u), is_first);
        doubtful_t = select(doubtful_t, next_t, is_first);
        let is_first_a = is_doubtful && doubtful_a == NO_HIT && source == FIRST_CAMERA;
        doubtful_a = select(doubtful_a, test.hit, is_first_a);
        doubtful_t_a = select(doubtful_t_a, next_t, is_first_a);
        previous_t = t;
        t = next_t;
    }
    // Doubtful surfaces that the direction crosses come first: other views show less of near geometry.
    var crossing = NO_HIT;
    if (CAMERAS > 0u && doubtful_a != NO_HIT) {
        crossing = plane_crossing(depth_4, m.a, along_a, doubtful_t_a, doubtful_a);
    }
    if ((CAMERAS > 0u || LAYERS > 1u) && doubtful != NO_HIT && crossing == NO_HIT) {
        crossing = plane_crossing(depth_0, m.main, along, doubtful_t, doubtful);
    }
    if (crossing != NO_HIT) {
        return crossing;
    }
    if (found != NO_HIT && hit_source(found) == 0u) {
        return refine_hit(depth_0, m.main, along, previous_t, t, found);
    }
    if (CAMERAS > 0u && found != NO_HIT && hit_source(found) == FIRST_CAMERA) {
        return refine_hit(depth_4, m.a, along_a, previous_t, t, found);
    }
    return found;
}
