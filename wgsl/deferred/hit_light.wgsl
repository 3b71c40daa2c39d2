// The light that a surface point which a ray has hit reflects back along the ray: a sample of the lights, of a constant
// environment, and of a further source of the importing shader, each with a shadow ray. L = sum f_r L_i cos / density.
// Errs blurry: lobes of hits are widened, since a lamp in a sharp mirror that another surface reflects is found too seldom
// (path regularization, Kaplanyan and Dachsbacher 2013).
#import "scene/lights.wgsl"
#import "scene/trace.wgsl"
#import "common/lobes.wgsl"

// Least GGX alpha of a hit. Rooms of kind glossy, seeds 100 to 102, and many 102, one bounce, 24 frames of 48x27, mean
// relMSE with 0.02, 0.05 and 0.16: 0.20, 0.18 and 0.20.
const LEAST_ALPHA: f32 = 0.05;

const NO_BOUND: f32 = 1e30;

// A surface point that a path has hit.
struct PathPoint {
    surface: Surface,
    brdf: Brdf,
    side: vec3f,     // geometric normal on the side of the path
    frame: mat3x3f,  // of the shading normal
    w_o: vec3f,      // back along the path, in that frame
    most: f32,       // bound of pi f_r
}

// Returns the point of a hit; `direction`: of the ray, unit.
fn path_point(s: Surface, direction: vec3f) -> PathPoint {
    let frame = frame_from_normal(s.normal);
    let side = select(-s.geometric_normal, s.geometric_normal, s.front);
    return PathPoint(s, widened(surface_brdf(s)), side, frame, -direction * frame, NO_BOUND);
}

// Returns a BRDF whose lobe is no narrower than LEAST_ALPHA.
fn widened(brdf: Brdf) -> Brdf {
    return widened_to(brdf, LEAST_ALPHA);
}

// Light that arrives at a point unless something blocks it, W/m2, and the way that a shadow ray must be clear.
struct Arrival {
    irradiance: vec3f,  // times pi f_r
    way: vec3f,
    limit: f32,         // in lengths of the way; 0: no light
}

// Returns pi f_r of light that arrives along `to_light`, unit.
fn reflectance_towards(p: PathPoint, to_light: vec3f) -> vec3f {
    let w_i = to_light * p.frame;
    let faces = w_i.z > 0.0 && dot(p.side, to_light) > 0.0;
    return select(vec3f(0.0), min(PI * evaluate_brdf(p.brdf, p.w_o, w_i).rgb, vec3f(p.most)), faces);
}

// Returns pi f_r times the cosine.
fn reflected_share(p: PathPoint, to_light: vec3f) -> vec3f {
    return reflectance_towards(p, to_light) * dot(p.surface.normal, to_light);
}

// Returns the light of a sampled light.
fn arrival_from_light(p: PathPoint, choice: f32, u: vec2f) -> Arrival {
    let light = sample_light(p.surface.position, choice, u);
    let arriving = light.weighted * reflected_share(p, light.direction);
    return Arrival(arriving, light.to_light, select(0.0, light.limit, max3(arriving) > 0.0));
}

fn no_arrival() -> Arrival {
    return Arrival(vec3f(0.0), vec3f(0.0), 0.0);
}

// Returns the ray of an arrival. Only the start is shifted off the surface; the end stays.
fn arrival_ray(s: Surface, arrival: Arrival) -> Ray {
    let start = leave_surface(s, arrival.way);
    let shift = select(vec3f(0.0), start - s.position, arrival.limit < INFINITELY_FAR);
    return Ray(start, arrival.way - shift);
}

// Returns the radiance that a point reflects back along the path, W/(m2 sr). `further`: light of a further source, or
// no_arrival(); `index`, `code`: place and seed of a low-discrepancy sequence.
fn reflected_radiance(p: PathPoint, further: Arrival, index: u32, code: u32) -> vec3f {
    // Sample the lights.
    var direct = no_arrival();
    if ((scene.light_count > 0u) & (dot(p.side, p.side) > 0.0)) {
        direct = arrival_from_light(p, sobol_2d(index, hash2(code, 1u)).y, sobol_2d(index, hash2(code, 3u)));
    }
    var rays: Rays;
    rays.shadow_a = arrival_ray(p.surface, direct);
    rays.limit_a = direct.limit;
    rays.shadow_b = arrival_ray(p.surface, further);
    rays.limit_b = further.limit;
    // A constant environment is not in the table of lights: sample the cosine.
    var sky = vec3f(0.0);
    if (HAS_ENVIRONMENT && !HAS_PICTURED_ENVIRONMENT) {
        let local = sample_cosine_hemisphere(sobol_2d(index, hash2(code, 4u)));
        let way = p.frame * local;
        sky = scene.environment_color * reflected_share(p, way) * (PI / max(local.z, 1e-6));
        rays.main = Ray(leave_surface(p.surface, way), way);
        rays.limit = select(0.0, FLOAT_MAX, max3(sky) > 0.0);
    }
    let found = trace_all(rays);
    var sum = select(direct.irradiance * found.tint_a, vec3f(0.0), found.occluded_a);
    sum += select(further.irradiance * found.tint_b, vec3f(0.0), found.occluded_b);
    sum += select(vec3f(0.0), sky * found.hit.tint, found.hit.triangle == NONE);
    return sum * INV_PI;
}
