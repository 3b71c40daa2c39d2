// Traces an undecided direction through the scene's hierarchy. The importing shader defines fn store_light(entry:
// HitEntry), which gives other hits than those of matte surfaces in the picture their light.
#import "scene/trace.wgsl"
#import "scene/surface.wgsl"
#import "ssdo/directions.wgsl"
#import "ssdo/shown_surface.wgsl"
#import "ssdo/undecided_list.wgsl"

override NEEDS_LIGHT: bool = true;  // false: only whether it hits

@group(1) @binding(13) var<storage, read_write> hits: array<vec2u>;  // packed by `ssdo/hit_code.wgsl`

// An off-screen hit: no picture has its light.
struct HitEntry {
    index: u32,         // of the direction in `hits`
    pixel: vec2u,       // that it leaves
    direction: vec3f,   // unit
    weight: f32,        // of the light
    hit: Hit,
    surface: Surface,
}

// Returns the pixel that shows a point of a matte surface, or `view.size`. `side`: geometric normal on the ray's side.
fn pixel_showing(point: vec3f, side: vec3f) -> vec2u {
    let pixel = pixel_of_point(point);
    if (any(pixel >= view.size)) {
        return view.size;
    }
    let shown = shown_surface(pixel);
    return select(view.size, pixel, shown.is_matte && is_on_surface(shown, point) && dot(shown.normal, side) > 0.0);
}

// Stores the radiance that arrives along a direction, W/(m2 sr).
fn store_radiance(index: u32, direction: vec3f, radiance: vec3f) {
    hits[index] = vec2u(
        pack_radiance(select(vec3f(0.0), radiance, is_finite(radiance))),
        pack_hit_direction(HitDirection(direction, 1.0, true, true)));
}

// Returns whether a direction passes see-through surfaces: by chance, as often as their light passes.
fn passes_by_chance(tint: vec3f, index: u32) -> bool {
    return !(HAS_SEE_THROUGH || PASSES_GLASS) || unit_float(hash2(index, bitcast<u32>(hits[index].y))) < luminance(tint);
}

// Traces a direction; `index`: of its entry in `hits`.
fn trace_direction(index: u32) {
    // The ray leaves the pixel's surface, on the side of the direction.
    let slot = slot_of(index);
    let pixel = pixel_of_slot(slot);
    let code = hits[index].y;
    let direction = octahedral_decode(unpack2x16snorm(code));
    let surface = load_surface(pixel);
    let seen = pixel_ray(pixel);
    let position = seen.origin + seen.direction * load_distance(pixel);
    let offset = ray_offset(surface.geometric_normal, pixel_terms(position));
    let ray = Ray(offset_origin(position, surface.geometric_normal, offset, direction), direction);
    if (!NEEDS_LIGHT) {
        let found = trace_shadow(ray, FLOAT_MAX);
        let is_free = !found.occluded_a && passes_by_chance(found.tint_a, index);
        hits[index] = vec2u(select(DARK_HIT, NO_HIT, is_free), code);
        return;
    }
    let hit = trace(ray, FLOAT_MAX);
    if (hit.triangle == NONE) {
        hits[index] = vec2u(NO_HIT, code);
        return;
    }
    // Find the light of the hit, in the picture or elsewhere.
    var weight = luminance(hit.tint);
    if (SAMPLE_ENVIRONMENT && index % (DIRECTIONS + LOBES) < DIRECTIONS) {
        weight *= 0.5 * direction_weight(direction, surface.normal);
    }
    let s = surface_at(hit, direction);
    let side = select(-s.geometric_normal, s.geometric_normal, s.front);
    let shown = pixel_showing(s.position, side);
    if (all(shown < view.size)) {
        hits[index] = vec2u(pack_hit(shown, 0u), pack_hit_direction(HitDirection(direction, weight, true, false)));
        return;
    }
    store_light(HitEntry(index, pixel, direction, weight, hit, s));
}
