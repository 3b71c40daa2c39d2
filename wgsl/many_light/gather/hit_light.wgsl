// The light that a surface point which a ray has hit reflects back along the ray: a sample of the lights, of a constant
// environment, and of one VPL, each with a shadow ray. L = sum f_r L_i cos / density. The importing shader declares `params`
// with vpl_count. Errs blurry: lobes of hits are widened, since a lamp in a sharp mirror that another surface reflects is found
// too seldom (path regularization, Kaplanyan and Dachsbacher 2013). VPLs on metals light hits as if they were matte.
#import "scene/lights.wgsl"
#import "scene/trace.wgsl"
#import "common/coat.wgsl"
#import "many_light/vpl/table.wgsl"
#import "many_light/gather/bound.wgsl"
#import "many_light/near_field/share.wgsl"

override REFLECTS_VPLS: bool = true;
override HAS_ENVIRONMENT: bool = true;

// Least GGX alpha of a hit. Rooms of kind glossy, seeds 100 to 102, and many 102, one bounce, 24 frames of 48x27, mean relMSE with
// 0.02, 0.05 and 0.16: 0.20, 0.18 and 0.20.
const LEAST_ALPHA: f32 = 0.05;
// Candidates for the VPL that lights y, drawn by their unshadowed light (Talbot et al. 2005). 128 take 5 % more time of
// a frame of 320x180 and are no less noisy.
const CANDIDATES: u32 = 32u;
// q over the mean bound of all VPLs: more is less noisy and takes more time, since more rays hit.
const PROPOSED: f32 = 2.0;

// A surface point that a path has hit.
struct PathPoint {
    surface: Surface,
    brdf: Brdf,
    side: vec3f,     // geometric normal on the side of the path
    frame: mat3x3f,  // of the shading normal
    w_o: vec3f,      // back along the path, in that frame
}

// Returns the point of a hit; `direction`: of the ray, unit.
fn path_point(s: Surface, direction: vec3f) -> PathPoint {
    let frame = frame_from_normal(s.normal);
    let side = select(-s.geometric_normal, s.geometric_normal, s.front);
    return PathPoint(s, widened(surface_brdf(s)), side, frame, -direction * frame);
}

// Returns a BRDF whose lobe is no narrower than LEAST_ALPHA.
fn widened(brdf: Brdf) -> Brdf {
    var wide = brdf;
    if (brdf.glossy && brdf.alpha < LEAST_ALPHA) {
        wide.alpha = LEAST_ALPHA;
        wide.fit = fit_coat(LEAST_ALPHA);
    }
    return wide;
}

// Light that arrives at a point unless something blocks it, W/m2, and the way that a shadow ray must be clear.
struct Arrival {
    irradiance: vec3f,  // times pi f_r
    way: vec3f,
    limit: f32,         // in lengths of the way; 0: no light
}

// What the VPLs say about a point: the light of one of them there, and the share of light that their bound removes.
struct VplsAtPoint {
    arrival: Arrival,
    removed: f32,       // 0 to 1
}

// Returns pi f_r of light that arrives along `to_light`, unit.
fn reflectance_towards(p: PathPoint, to_light: vec3f) -> vec3f {
    let w_i = to_light * p.frame;
    let faces = w_i.z > 0.0 && dot(p.side, to_light) > 0.0;
    return select(vec3f(0.0), PI * evaluate_brdf(p.brdf, p.w_o, w_i).rgb, faces);
}

// Returns pi f_r times the cosine.
fn reflected_share(p: PathPoint, to_light: vec3f) -> vec3f {
    return reflectance_towards(p, to_light) * dot(p.surface.normal, to_light);
}

fn arrival_from_light(p: PathPoint, choice: f32, u: vec2f) -> Arrival {
    let light = sample_light(p.surface.position, choice, u);
    let arriving = light.weighted * reflected_share(p, light.direction);
    return Arrival(arriving, light.to_light, select(0.0, light.limit, max3(arriving) > 0.0));
}

// Draws a VPL in proportion to its light at a point, and averages the share that the bounds of VPLs nearby remove at a
// squared distance; if none lies on a surface like that of the point, the share of the mean bound. `reach`: q, the
// squared radius of the kernel of that mean, m2.
fn vpls_at_point(p: PathPoint, squared_distance: f32, reach: f32, u: vec2f) -> VplsAtPoint {
    var sum = 0.0;
    var color = vec3f(0.0);
    var chosen_way = vec3f(0.0);
    var random = u.y;
    var removed = 0.0;
    var weights = 0.0;
    for (var k = 0u; k < CANDIDATES; k += 1u) {
        let slot = min(u32((f32(k) + u.x) / f32(CANDIDATES) * f32(params.vpl_count)), params.vpl_count - 1u);
        let vpl = load_vpl(slot);
        let way = vpl.position - p.surface.position;
        let squared = dot(way, way);
        let bound = bound_of(vpl);
        // Bright VPLs lose more light to their bound.
        let near = reach / (squared + reach);
        let near_weight = luminance(vpl.flux) * near * near;
        let counts = select(0.0, near_weight, dot(p.side, vpl.normal) > SIMILAR_NORMALS);
        removed += counts * bound / max(squared_distance + bound, 1e-37);
        weights += counts;
        if (!REFLECTS_VPLS) {
            continue;
        }
        let leaving = max(-dot(way, vpl.normal), 0.0);
        let arriving = max(dot(way, p.surface.normal), 0.0);
        let geometry = leaving * arriving / max(squared * (squared + bound), 1e-37);
        let weight = luminance(vpl.flux) * geometry;
        if (weight > 0.0) {
            // Keep this candidate with the probability weight / sum, and use the random number again.
            sum += weight;
            let share = weight / sum;
            let takes = random < share;
            random = select((random - share) / max(1.0 - share, 1e-7), random / share, takes);
            if (takes) {
                color = vpl.flux / luminance(vpl.flux);
                chosen_way = way;
            }
        }
    }
    // Reflect the light of the chosen candidate, over its probability.
    let to_vpl = normalize_or(chosen_way, p.side);
    let reflected = reflectance_towards(p, to_vpl);
    let scale = sum * INV_PI * f32(params.vpl_count) / f32(CANDIDATES);
    let chosen = Arrival(color * reflected * scale, chosen_way, select(0.0, STOP_SHORT, sum > 0.0));
    let usual = reach / PROPOSED;
    let mean = removed / max(weights, 1e-37);
    return VplsAtPoint(chosen, select(usual / max(squared_distance + usual, 1e-37), mean, weights > 0.0));
}

// Returns the ray of an arrival. Only the start is shifted off the surface; the end stays.
fn arrival_ray(s: Surface, arrival: Arrival) -> Ray {
    let start = leave_surface(s, arrival.way);
    let shift = select(vec3f(0.0), start - s.position, arrival.limit < INFINITELY_FAR);
    return Ray(start, arrival.way - shift);
}

// Returns the radiance that a point reflects back along the path, W/(m2 sr).
fn reflected_radiance(p: PathPoint, indirect: Arrival, index: u32, code: u32) -> vec3f {
    // Sample the lights.
    var direct = Arrival(vec3f(0.0), vec3f(0.0), 0.0);
    if ((scene.light_count > 0u) & (dot(p.side, p.side) > 0.0)) {
        direct = arrival_from_light(p, sobol_2d(index, hash2(code, 1u)).y, sobol_2d(index, hash2(code, 3u)));
    }
    var rays: Rays;
    rays.shadow_a = arrival_ray(p.surface, direct);
    rays.limit_a = direct.limit;
    rays.shadow_b = arrival_ray(p.surface, indirect);
    rays.limit_b = indirect.limit;
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
    var sum = select(direct.irradiance, vec3f(0.0), found.occluded_a);
    sum += select(indirect.irradiance, vec3f(0.0), found.occluded_b);
    sum += select(vec3f(0.0), sky, found.hit.triangle == NONE);
    return sum * INV_PI;
}
