// One light's irradiance and its reflection, for the pass that filters shadow maps and the one that traces shadow rays.
#import "scene/info.wgsl"
#import "deferred/shadow/lookup.wgsl"
#import "deferred/direct/receiver.wgsl"
#import "common/spot.wgsl"

const EDGE_GROUP: u32 = 64u;  // pixels that a workgroup of `edges.wgsl` takes per turn

struct Incident {
    to_light: vec3f,    // metres; unit for suns
    direction: vec3f,   // unit
    irradiance: vec3f,  // on a surface that faces the light, unshadowed, W/m2
}

// Returns the light that arrives at a position, unshadowed. A sample of an emitter counts as a disc of its area: form
// factor A cos / (d^2 + A / pi), bounded where the plain A cos / d^2 is not (Wallace et al. 1989, "A Ray Tracing
// Algorithm for Progressive Radiosity", eq. 5).
fn light_at(light: DirectLight, position: vec3f) -> Incident {
    if (HAS_SUNS && (!HAS_LAMPS || light.kind == DIRECT_SUN)) {
        return Incident(-light.direction, -light.direction, light.color);
    }
    let to_light = light.position - position;
    // Keeps 1 / d^2 finite.
    let squared = max(dot(to_light, to_light), 1e-30);
    let direction = to_light * inverseSqrt(squared);
    let cosine = -dot(light.direction, direction);
    let falloff = spot_falloff(-direction, light.direction, light.cone_scale, light.cone_offset);
    let shape = select(1.0, falloff, light.kind == DIRECT_SPOT);
    let facing = select(max(cosine, 0.0), abs(cosine), light.both_sides != 0u);
    let is_area = light.kind == DIRECT_AREA;
    let strength = select(shape, light.area * facing, is_area) / (squared + select(0.0, light.area * INV_PI, is_area));
    // KHR_lights_punctual: the window of a light with a range.
    let share = squared * light.inverse_range * light.inverse_range;
    return Incident(to_light, direction, light.color * (strength * clamp(1.0 - share * share, 0.0, 1.0)));
}

// Returns the radiance scattered to the eye, W/(m2 sr), unshadowed.
fn reflected(r: Receiver, incident: Incident) -> vec3f {
    let cosine = dot(r.normal, incident.direction);
    if (cosine <= 0.0 || max3(incident.irradiance) <= 0.0) {
        return vec3f(0.0);
    }
    return scattered(r.brdf, r.w_o, r.eye_loss, incident.direction * r.frame) * incident.irradiance * cosine;
}
