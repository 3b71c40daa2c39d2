// The origin of a ray that leaves a surface: offset along the geometric normal n by more than the rounding error of the
// point p across its plane.
//
// start = p +- n offset, offset = 8 u (|n| . m + r max(m)), on the ray's side of the surface. u = 2^-24 is the unit
// roundoff of float32; m bounds, by axis, the terms that p is the sum of, in metres; r = |n.x| + |n.y| + |n.z| - max |n|.
// A plane across an axis has r = 0, so only the coordinate along that axis counts.
//
// Size (Waechter and Binder 2019, "A Fast and Robust Method for Avoiding Self-Intersection"; here from a bound of the
// error): a hit is a + b1 edge1 + b2 edge2, m = |a| + |b1 edge1| + |b2 edge2|; where neither edge has a component along an
// axis, a + 0 + 0 is exact and m is 0. Of 3 million random triangles whose edges meet at a sine above 0.1, the next
// ray's test saw p at most 4.3 u (|n| . m + r max(m)) off, and under transforms at most 16 times, so m counts twice there.
// Since |a| <= 2 |p| (`upload/anchors.py`), m is about 2 |p| at a point whose triangle is not known. At pixels' points it
// is 4 times that, for slivers: with once or twice, a folded curtain of strips 1 by 90 lets light through
// (`test_defaults_agree_with_mitsuba`).
// The offset grows with the distance from the scene's origin, not with the triangle. Errs bright: rays miss blockers
// nearer than the offset, 0.5e-6 to 12e-6 |p|. Slivers amplify the test's rounding by the inverse of their sine and may
// shadow themselves.
//
// The normal must be geometric: an offset along a tilted shading normal clears the surface by less, or goes through it.
#import "scene/geometry.wgsl"
#import "common/math.wgsl"

const ROUNDING: f32 = 8.0 * 5.9604645e-8;

// Factor on the terms of pixels' points.
const SLIVERS: f32 = 4.0;

// A stand-in for unknown normals, with the largest offset.
const ANY_NORMAL: vec3f = vec3f(0.57735);

// Shadow rays end at this share of their length, short of the emitter's own surface, whose point is rounded by about 2
// u |p|. This suffices for lights farther than |p| / 800 over the cosine at the light. Errs bright: rays miss blockers
// in the last 0.01 % of their length.
const STOP_SHORT: f32 = 0.9999;

// Returns the offset of a point, metres. `normal`: geometric, unit; `terms`: m, metres.
fn ray_offset(normal: vec3f, terms: vec3f) -> f32 {
    let lean = abs(normal);
    let rest = lean.x + lean.y + lean.z - max3(lean);
    return ROUNDING * (dot(lean, terms) + rest * max3(terms));
}

// Returns m of a surface point whose triangle is not known.
fn surface_terms(position: vec3f) -> vec3f {
    return 2.0 * abs(position);
}

// Returns m of a pixel's surface point: origin + direction * distance.
fn pixel_terms(position: vec3f) -> vec3f {
    return SLIVERS * (surface_terms(position) + abs(position - view.position));
}

// Returns m of a hit, in the space of the triangle.
fn hit_terms(t: Triangle, hit: Hit) -> vec3f {
    let along1 = abs(hit.from_anchor.x * t.edge1);
    let along2 = abs(hit.from_anchor.y * t.edge2);
    let is_exact = abs(t.edge1) + abs(t.edge2) == vec3f(0.0);
    return select(abs(t.anchor) + along1 + along2, vec3f(0.0), is_exact);
}

// Returns m of a hit in the world, given that in the space of its mesh; twice, for the next ray's inverse transform.
fn transformed_terms(world_from_local: mat4x3f, terms: vec3f) -> vec3f {
    let w = world_from_local;
    return 2.0 * (abs(w[0]) * terms.x + abs(w[1]) * terms.y + abs(w[2]) * terms.z + abs(w[3]));
}

// Returns the origin of a ray in `direction` (any length). `normal`: geometric, unit, on either side.
fn offset_origin(position: vec3f, normal: vec3f, offset: f32, direction: vec3f) -> vec3f {
    return position + normal * select(-offset, offset, dot(direction, normal) > 0.0);
}
