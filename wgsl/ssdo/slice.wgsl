// A slice of the hemisphere: the directions in a half-plane on either side of the axis from the receiver to the eye,
// and the cosine-weighted solid angle of its arcs.
//
// w = cos(t) axis + sin(t) tangent, dw = |sin t| dt d(azimuth), so that
// integral f(w) cos dw = integral d(azimuth) integral f (n . w) |sin t| dt: Therrien, Levesque and Gilet 2023, "Screen
// Space Indirect Lighting with Visibility Bitmask"; Jimenez et al. 2016, "Practical Realtime Strategies for Accurate
// Indirect Occlusion". Departure: azimuths are drawn in proportion to the measure of their slice, W = n . axis + tilt
// (n . tangent). All slices then weigh the same, and shares of their measure estimate shares of the hemisphere's.
#import "common/math.wgsl"

struct Slice {
    axis: vec3f,         // unit, towards the eye
    tangent: vec3f,      // unit, across the axis; angles are positive on its side
    cos_axis: f32,       // of the normal to the axis, above 0
    cos_tangent: f32,
    tilt: f32,           // angle of n projected onto the slice
    first: f32,          // measure of the negative side
    inverse_total: f32,  // 1 / W
}

// Least cosine of normal and axis: shading normals that face away from the eye are bent towards it.
const LEAST_FACING: f32 = 1e-2;
// Newton steps of slice_azimuth(): the error of the share is below 1e-5 for all normals.
const AZIMUTH_STEPS: u32 = 3u;
// Bisections of slice_angle(), down to half a degree; a linear step follows.
const ANGLE_STEPS: u32 = 8u;

// Returns the azimuth, 0 to pi, up to which the slices hold a share `u` of the hemisphere's measure. `cosine`: of
// normal and axis; the normal's azimuth is 0. The measure of slices up to an azimuth a is psi + tilt sin(normal)
// sin(a), with tan(psi) = cosine tan(a).
fn slice_azimuth(cosine: f32, u: f32) -> f32 {
    let sine = sqrt(max(1.0 - cosine * cosine, 0.0));
    // The second half mirrors the first. There the measure is a concave function, so Newton steps from a lower bound
    // rise to the solution.
    let half = min(u, 1.0 - u);
    var azimuth = asin(saturate(2.0 * half));
    for (var k = 0u; k < AZIMUTH_STEPS; k += 1u) {
        let c = cos(azimuth);
        let s = sin(azimuth);
        let tilt = atan2(sine * c, cosine);
        let measure = atan2(cosine * s, c) + tilt * sine * s;
        azimuth = clamp(azimuth + (PI * half - measure) / max(cosine + tilt * sine * c, 1e-6), 0.0, 0.5 * PI);
    }
    return select(azimuth, PI - azimuth, u > 0.5);
}

// Returns the slice at a share `u` of the hemisphere's measure. `fallback`: where azimuths begin if the normal is along
// the axis.
fn slice_at(axis: vec3f, normal: vec3f, fallback: vec3f, u: f32) -> Slice {
    let bent = normalize(normal + axis * max(LEAST_FACING - dot(axis, normal), 0.0));
    let cosine = dot(axis, bent);
    let aside = bent - axis * cosine;
    let away = fallback - axis * dot(axis, fallback);
    let start = normalize(select(away, aside, dot(aside, aside) > 1e-6));
    let azimuth = slice_azimuth(cosine, u);
    let tangent = start * cos(azimuth) + cross(axis, start) * sin(azimuth);
    let cos_tangent = dot(bent, tangent);
    let tilt = atan2(cos_tangent, cosine);
    // The negative side ends at the angle pi / 2 - tilt.
    let c = cos(tilt);
    let first = 0.5 * (cosine * c * c - cos_tangent * (0.5 * PI - tilt - c * sin(tilt)));
    return Slice(axis, tangent, cosine, cos_tangent, tilt, first, 1.0 / (cosine + tilt * cos_tangent));
}

// Returns the share of the slice's measure, 0 to 1, from its negative horizon to a direction. `cosine`, `sine`: of its
// signed angle.
fn share_up_to(slice: Slice, cosine: f32, sine: f32) -> f32 {
    // The integral of (cos_axis cos t + cos_tangent sin t) |sin t| from the axis on.
    let angle = acos(clamp(cosine, -1.0, 1.0));
    let from_axis = 0.5 * (slice.cos_axis * abs(sine) * sine + slice.cos_tangent * (angle - abs(sine) * cosine));
    let share = saturate((slice.first + from_axis) * slice.inverse_total);
    let is_below = slice.cos_axis * cosine + slice.cos_tangent * sine <= 1e-6;
    return select(share, select(0.0, 1.0, sine > 0.0), is_below);
}

// Returns the angle up to which the slice holds a share of its measure: the inverse of share_up_to().
fn slice_angle(slice: Slice, share: f32) -> f32 {
    var low = slice.tilt - 0.5 * PI;
    var high = slice.tilt + 0.5 * PI;
    var ends = vec2f(0.0, 1.0);
    for (var k = 0u; k < ANGLE_STEPS; k += 1u) {
        let middle = 0.5 * (low + high);
        let there = share_up_to(slice, cos(middle), sin(middle));
        let is_beyond = there > share;
        high = select(high, middle, is_beyond);
        low = select(middle, low, is_beyond);
        ends = select(vec2f(there, ends.y), vec2f(ends.x, there), is_beyond);
    }
    return mix(low, high, saturate((share - ends.x) / max(ends.y - ends.x, 1e-9)));
}
