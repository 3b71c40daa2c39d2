// Connections of a path's vertex with a light (N) and with the hit of a light ray (L), as `path.wgsl` names them: the
// shadow ray to send, and the light that arrives at the camera if nothing blocks it.
#import "scene/lights.wgsl"
#import "scene/trace.wgsl"
#import "common/random.wgsl"
#import "reference/guide.wgsl"
#import "reference/medium.wgsl"
#import "reference/weights.wgsl"

// Pairs of dimensions of a light ray's random numbers: its choices, point and direction.
const LIGHT_RAY_PAIR: u32 = 1u;

// A path's hit on a surface.
struct PathVertex {
    surface: Surface,
    brdf: Brdf,
    frame: mat3x3f,      // about the shading normal
    w_o: vec3f,          // in the frame, unit
    throughput: vec3f,   // of the path up to here, over its densities
    density: f32,        // of this point by the path's own rays, 1/m2; 0: the camera ray's hit
    medium: Medium,      // on the viewer's side
}

// The hit of a light ray.
struct LightVertex {
    brdf: Brdf,
    position: vec3f,
    offset: f32,             // of rays that leave it, metres; below 0: there is no hit
    normal: vec3f,           // shading, on the light's side, unbent
    brdf_normal: vec3f,      // shading, facing the light, of the BRDF's frame
    bumped: bool,
    ray_density: f32,        // of the light ray, 1/m2
    geometric_normal: vec3f,
    light_pdf: f32,          // N's density of the light ray's origin, seen from here, 1/sr; 0 without area
    to_light: vec3f,         // unit
    flux: vec3f,             // W; divided by the densities and the cosine at the geometric normal
}

struct Connection {
    ray: Ray,
    limit: f32,       // in lengths of the ray; 0: there is no connection
    radiance: vec3f,  // at the camera, W/(m2 sr)
    cell: u32,        // of the guide, that a light's rays pass; NONE: none
}

fn no_connection() -> Connection {
    return Connection(Ray(vec3f(0.0), vec3f(0.0)), 0.0, vec3f(0.0), NONE);
}

// A light ray, and the cell of the guide that it passes.
struct GuidedRay {
    sent: LightRay,
    cell: u32,  // NONE: it is not guided
}

// Returns the light ray of path `index` of a pixel.
fn path_light_ray(index: u32, pixel_seed: u32, guide: Guide) -> GuidedRay {
    let choices = sobol_2d(index, hash2(pixel_seed, LIGHT_RAY_PAIR));
    let u_point = sobol_2d(index, hash2(pixel_seed, LIGHT_RAY_PAIR + 1u));
    let u_direction = sobol_2d(index, hash2(pixel_seed, LIGHT_RAY_PAIR + 2u));
    let number = pick_number(choices.x);
    let light = lights[number];
    if (ADAPTIVE && HAS_PUNCTUAL_LIGHTS && is_guided(number, light.kind)) {
        // A sun's ray uses the one point, a punctual light's the other.
        let guided = guided_point(guide, number, select(u_direction, u_point, light.kind == KIND_SUN));
        var sent = sample_ray_of(light, choices.y, guided.u, guided.u);
        sent.flux /= guided.density;
        sent.ray_density *= guided.density;
        return GuidedRay(sent, guided.cell);
    }
    return GuidedRay(sample_ray_of(light, choices.y, u_point, u_direction), NONE);
}

// Returns the vertex at a light ray's hit. `cosine`: between the ray and the surface's geometric normal.
fn light_vertex(surface: Surface, sent: LightRay, squared_distance: f32, cosine: f32) -> LightVertex {
    let falloff = select(1.0 / squared_distance, 1.0, sent.parallel);
    let to_light = -sent.ray.direction;
    return LightVertex(
        surface_brdf(surface), surface.position, surface.offset, surface.unbent_normal, surface.normal,
        surface.bumped, sent.ray_density * cosine * falloff, surface.geometric_normal, sent.pdf / falloff,
        to_light, sent.flux / cosine);
}

// Returns the cosine of a direction; for surfaces that light may pass, its size.
fn passing_cosine(normal: vec3f, direction: vec3f) -> f32 {
    let cosine = dot(normal, direction);
    return select(cosine, abs(cosine), HAS_TRANSMISSION);
}

// Connects a vertex with a point of a light (N): next-event estimation. `choice` picks the light, `u` the point.
fn connect_light(v: PathVertex, choice: f32, u: vec2f, guide: Guide) -> Connection {
    let number = pick_number(choice);
    let listed = lights[number];
    let light = sample_point_of(listed, v.surface.position, u);
    let w_i = light.direction * v.frame;
    let f = evaluate_brdf(v.brdf, v.w_o, w_i);
    let cosine = passing_cosine(v.surface.normal, light.direction);
    let faces = light.limit > 0.0 && f.w > 0.0 && cosine > 0.0 && sides_agree(v.surface, v.brdf, light.direction, w_i);
    if (!faces) {
        return no_connection();
    }
    var ray_density = light.ray_density * abs(dot(v.surface.geometric_normal, light.direction));
    var cell = NONE;
    if (ADAPTIVE && HAS_PUNCTUAL_LIGHTS && v.density > 0.0) {
        cell = cell_towards(listed, number, v.surface.position);
        ray_density *= guide_density(guide, cell);
    }
    let weight = weight_of_light(light.pdf, f.w, v.density, ray_density);
    var radiance = v.throughput * f.rgb * cosine * light.weighted * weight;
    if (HAS_VOLUMES && light.limit < INFINITELY_FAR) {
        let medium = medium_beyond(v.surface, light.direction, v.medium);
        radiance *= volume_transmittance(medium.absorption, length(light.to_light));
    }
    if (max3(radiance) > 0.0) {
        let start = leave_surface(v.surface, light.direction);
        // Shift only the start; the end stays.
        let shift = select(vec3f(0.0), start - v.surface.position, light.limit < INFINITELY_FAR);
        return Connection(Ray(start, light.to_light - shift), light.limit, radiance, cell);
    }
    return no_connection();
}

// Connects a vertex with the hit of a light ray (L).
fn connect_light_vertex(v: PathVertex, lit: LightVertex) -> Connection {
    let between = lit.position - v.surface.position;
    let squared = dot(between, between);
    let direction = normalize_or(between, v.surface.normal);
    // Both surfaces scatter: f at the path's vertex, g at the light ray's.
    let w_i = direction * v.frame;
    let f = evaluate_brdf(v.brdf, v.w_o, w_i);
    let cosine = passing_cosine(v.surface.normal, direction);
    // The normal at the light ray's hit is the one that a path from here finds.
    let outward = dot(lit.geometric_normal, direction) < 0.0;
    let across = outward != (dot(lit.geometric_normal, lit.to_light) > 0.0);
    let side = select(-lit.geometric_normal, lit.geometric_normal, outward);
    let lit_normal = facing_normal(select(lit.normal, -lit.normal, across), side, -direction, lit.bumped);
    let lit_frame = frame_from_normal(lit_normal);
    var lit_brdf = lit.brdf;
    if (HAS_LAYERS) {
        lit_brdf = turned_brdf(lit.brdf, frame_from_normal(lit.brdf_normal), lit_frame, across);
    }
    let from_lit = lit.to_light * lit_frame;
    let g = evaluate_brdf(lit_brdf, -direction * lit_frame, from_lit);
    let lit_cosine = abs(dot(lit.geometric_normal, direction));
    let faces = f.w > 0.0 && g.w > 0.0 && cosine > 0.0 && squared > 0.0;
    let passes = !HAS_TRANSMISSION || max3(lit_brdf.transmitted) <= 0.0 || across == (from_lit.z < 0.0);
    if (!faces || !passes || !sides_agree(v.surface, v.brdf, direction, w_i)) {
        return no_connection();
    }
    let own_density = f.w * lit_cosine / squared;
    let weight = weight_of_light_ray(lit.light_pdf, g.w, own_density, lit.ray_density);
    // N applies the shading normal's cosine to the light, too.
    let arriving = lit.flux * max(passing_cosine(lit_normal, lit.to_light), 0.0);
    var radiance = v.throughput * f.rgb * g.rgb * arriving * (cosine * lit_cosine / squared * weight);
    if (HAS_VOLUMES) {
        let medium = medium_beyond(v.surface, direction, v.medium);
        radiance *= volume_transmittance(medium.absorption, sqrt(squared));
    }
    if (max3(radiance) > 0.0) {
        let start = leave_surface(v.surface, direction);
        let end = offset_origin(lit.position, lit.geometric_normal, lit.offset, -direction);
        return Connection(Ray(start, end - start), STOP_SHORT, radiance, NONE);
    }
    return no_connection();
}
