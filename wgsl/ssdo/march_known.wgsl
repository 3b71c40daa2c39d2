// Screen-space ray marching that tells what the pictures show from what they do not: a direction hits a surface, leaves
// the scene, or is undecided.
//
// A direction hits if the main camera's first layer shows it meeting a surface from the front. It leaves if one view
// shows both ends of each of its steps in free space, up to the border of the scene. It is undecided as soon as a step
// leaves all pictures or goes behind a surface, and if r_max ends before the scene does. Errs bright where steps leap
// over a thin occluder, by STEPS.
#import "ssdo/march.wgsl"
#import "ssdo/shown_surface.wgsl"

// Steps of Newton's method to the surface that a direction meets; one is exact on a plane.
const CROSSING_STEPS: u32 = 3u;

// Returns the distance at which a direction leaves a sphere around the scene, metres.
fn distance_to_border(position: vec3f, way: vec3f) -> f32 {
    let from_centre = position - scene.centre;
    let along = dot(from_centre, way);
    let inside = scene.radius * scene.radius - dot(from_centre, from_centre);
    return max(sqrt(max(along * along + inside, 0.0)) - along, 0.0);
}

// Returns the hit where a direction meets the surface that hides its point at a pixel, or UNKNOWN_HIT if it passes behind
// that surface or if the picture does not tell what the surface sends that way. `way`: unit, of the world.
fn find_crossing(position: vec3f, way: vec3f, hidden_at: vec2u) -> u32 {
    var pixel = hidden_at;
    for (var k = 0u; k < CROSSING_STEPS; k += 1u) {
        // Intersect the plane of the surface that the pixel shows.
        let shown = shown_surface(pixel);
        let approach = -dot(shown.normal, way);
        let t = dot(shown.normal, position - shown.position) / max(approach, 1e-20);
        if (shown.width <= 0.0 || approach <= 0.0 || t <= 0.0) {
            return UNKNOWN_HIT;
        }
        // Test whether the pixel there shows the same surface.
        let point = position + t * way;
        let next = pixel_of_point(point);
        if (any(next >= view.size)) {
            return UNKNOWN_HIT;
        }
        let there = shown_surface(next);
        if (is_on_surface(there, point) && dot(there.normal, way) < 0.0) {
            return select(UNKNOWN_HIT, pack_hit(next, 0u), there.is_matte);
        }
        pixel = next;
    }
    return UNKNOWN_HIT;
}

// Returns the hit of a direction, NO_HIT if it leaves the scene, or UNKNOWN_HIT. `direction`: in the frame of the marcher;
// `way`: the same in the world. Points are spaced as those of march(); the last lies at the border.
fn march_known(m: Marcher, position: vec3f, direction: vec3f, way: vec3f, jitter: f32) -> u32 {
    let along = m.main.axes * direction;
    let along_a = m.a.axes * direction;
    let along_b = m.b.axes * direction;
    let along_c = m.c.axes * direction;
    let along_d = m.d.axes * direction;
    let border = distance_to_border(position, way);
    let range = min(m.radius, border);
    let scale = 1.0 / max(f32(STEPS) - 1.0 + jitter, 1e-3);
    var found = NO_HIT;
    // Whether each view shows the point before in free space.
    var was_free = true;
    var was_free_abcd = vec4<bool>(true);
    for (var k = 0u; k < STEPS && found == NO_HIT; k += 1u) {
        let share = min((f32(k) + jitter) * scale, 1.0);
        let t = range * share * share * sqrt(share);
        let point = project_point(m.main, along, t);
        let depth = textureLoad(depth_0, point.pixel, 0);
        let is_hidden = point.is_inside && depth > point.occluder_depth;
        let is_free = point.is_inside && !is_hidden;
        // Branch on no value of the thread: Mesa 22.3.6 crashes.
        var is_free_abcd = vec4<bool>(false);
        if (CAMERAS > 0u) {
            is_free_abcd.x = shows_free(depth_4, m.a, along_a, t);
        }
        if (CAMERAS > 1u) {
            is_free_abcd.y = shows_free(depth_5, m.b, along_b, t);
        }
        if (CAMERAS > 2u) {
            is_free_abcd.z = shows_free(depth_6, m.c, along_c, t);
        }
        if (CAMERAS > 3u) {
            is_free_abcd.w = shows_free(depth_7, m.d, along_d, t);
        }
        let is_known = (is_free & was_free) | any(is_free_abcd & was_free_abcd);
        found = select(
            select(UNKNOWN_HIT, pack_hit(vec2u(point.pixel), 0u), is_hidden & was_free), NO_HIT, is_known);
        was_free = is_free;
        was_free_abcd = is_free_abcd;
    }
    if (found == NO_HIT && border > m.radius) {
        return UNKNOWN_HIT;
    }
    if (found < UNKNOWN_HIT) {
        return find_crossing(position, way, hit_pixel(found));
    }
    return found;
}

// Returns whether a further camera shows the point `t` metres along a direction in free space.
fn shows_free(depths: texture_depth_2d, r: ReceiverInView, along: vec4f, t: f32) -> bool {
    let point = project_point(r, along, t);
    return point.is_inside && textureLoad(depths, point.pixel, 0) < point.depth;
}
