// One invocation gathers the light that the coat of a first-level pixel reflects, from one level (last bounce only).
// The importing shader defines fn prepare(start: Endpoint) and fn visibility(start: Endpoint, end: Endpoint, number:
// u32) -> f32.
//
// L = sum_i Phi_i cos_i cos'_i f_i V_i / (d_i^2 + R_i^2) / p_i, f the coat's part of the BRDF. Samples lie in the same disc or ring as in
// `gather.wgsl`; their angles about the pixel follow the projected lobe, f = 0.1 + exp(-s x^2 / 2 pi), where x is the
// angle from the projected mirror direction (section 4). Departures: s = 2 / alpha^2 - 2, the Phong exponent of a GGX
// lobe of the same width at its peak (Walter et al. 2007); lobes are widened by the solid angle of samples. In:
// G-buffer, surfels and light of the level. Out: radiance over coat_tint(), added to that of other levels. Errs noisy,
// and dark where the mirror direction leaves the picture.
#import "scene/sequence.wgsl"
#import "shared/gbuffer/load.wgsl"
#import "common/coat.wgsl"
#import "ssil/endpoint.wgsl"
#import "ssil/surfel.wgsl"
#import "common/light_code.wgsl"
#import "common/random.wgsl"

override SAMPLES: u32 = 16u;
override SQUARE: u32 = 2u;      // picture pixels per side of a pixel of the first level
override FINEST: bool = true;   // true: the disc; false: the ring

@group(1) @binding(11) var surfels: texture_storage_2d<rgba32uint, read>;
@group(1) @binding(12) var<storage, read> light: array<vec2u>;
@group(1) @binding(13) var<storage, read_write> glossy: array<vec4f>;
@group(1) @binding(19) var<uniform> params: Params;

struct Params {
    grid_size: vec2u,   // cells of the voxel grid, if any
    cell: f32,          // pixels of the picture along the side of a cell
    step: f32,          // of a march, cells
    light_offset: u32,  // the level's first entry in `light`
    shift: u32,         // levels above the first
    size: vec2u,        // pixels of the first level
    radius: f32,        // r, pixels of the level
    seed: u32,
}

const LEAST_DENSITY: f32 = 0.1;  // alpha of section 4
const ROOT_TWO_PI: f32 = 2.5066283;

struct AngleSample {
    angle: f32,   // from the lobe
    weight: f32,  // uniform density over the sample's density
}

// Samples an angle in proportion to f.
fn sample_angle(alpha: f32, choice: f32, u: vec2f) -> AngleSample {
    let exponent = max(2.0 / (alpha * alpha) - 2.0, 0.5);
    let width = sqrt(PI / exponent);
    let uniform_mass = LEAST_DENSITY * TWO_PI;
    let lobe_mass = width * ROOT_TWO_PI;
    let is_uniform = choice * (uniform_mass + lobe_mass) < uniform_mass;
    let normal = width * sqrt(-2.0 * log(max(1.0 - u.x, 1e-7))) * cos(TWO_PI * u.y);
    let unwrapped = select(normal, TWO_PI * u.x, is_uniform);
    let angle = unwrapped - TWO_PI * round(unwrapped / TWO_PI);
    // A wide lobe wraps around the circle.
    let x = vec3f(angle - TWO_PI, angle, angle + TWO_PI) / width;
    let lobe = exp(-0.5 * x * x);
    let density = (LEAST_DENSITY + lobe.x + lobe.y + lobe.z) / (uniform_mass + lobe_mass);
    return AngleSample(angle, 1.0 / (TWO_PI * density));
}

// Returns a direction at a point, projected to the picture: pixels right and down, of any length.
fn project_direction(position: vec3f, direction: vec3f) -> vec2f {
    let step = direction * (0.01 * length(position));
    let half = vec2f(dot(view.right, view.right), dot(view.up, view.up));
    let a = vec3f(dot(position, view.right), dot(position, view.up), dot(position, view.forward));
    let b = a + vec3f(dot(step, view.right), dot(step, view.up), dot(step, view.forward));
    let perspective = b.xy / max(b.z, 1e-30) - a.xy / max(a.z, 1e-30);
    let moved = select(perspective, b.xy - a.xy, view.orthographic != 0u) / half;
    return moved * vec2f(view.size) * vec2f(1.0, -1.0);
}

struct LobeSample {
    offset: vec2i,  // pixels
    count: f32,     // pixels that it represents
}

// Returns a sample around a pixel; `forward`: the lobe's direction in the picture, unit.
fn lobe_sample(number: u32, pixel_seed: u32, alpha: f32, forward: vec2f) -> LobeSample {
    let u = sobol_2d(number, pixel_seed);
    let lobe_angle = sample_angle(alpha, u.y, sobol_2d(number, ~pixel_seed));
    let r = params.radius;
    let radius = r * select(sqrt(0.25 + 0.75 * u.x), u.x, FINEST);
    let area = PI * r * select(0.75 * r, 2.0 * radius, FINEST) / f32(SAMPLES);
    let c = cos(lobe_angle.angle);
    let s = sin(lobe_angle.angle);
    let offset = radius * vec2f(c * forward.x - s * forward.y, s * forward.x + c * forward.y);
    return LobeSample(vec2i(round(offset)), area * lobe_angle.weight);
}

// Adds this level's reflection to that of a pixel of the first level.
fn gather_glossy(id: vec3u) {
    if (any(id.xy >= params.size)) {
        return;
    }
    let index = id.y * params.size.x + id.x;
    let pixel = min(id.xy * SQUARE + SQUARE / 2u, view.size - 1u);
    let hit_distance = load_distance(pixel);
    let surface = load_surface(pixel);
    let brdf = gbuffer_brdf(surface);
    if (hit_distance <= 0.0 || (surface.flags & GBUFFER_UNLIT) != 0u || !brdf.glossy) {
        glossy[index] = select(glossy[index], vec4f(0.0), FINEST);
        return;
    }
    // Find the receiver, and the projected mirror direction.
    let ray = pixel_ray(pixel);
    let size = vec2i(textureDimensions(surfels));
    let position = ray.origin - view.position + ray.direction * hit_distance;
    let start = Endpoint(vec2i(id.xy >> vec2u(params.shift)), position, surface.normal);
    prepare(start);
    let normal = surface.normal;
    let to_eye = -ray.direction;
    let eye_loss = loss_to_eye(brdf, normal, to_eye);
    let mirrored = project_direction(start.position, reflect(ray.direction, normal));
    let forward = mirrored * inverseSqrt(max(dot(mirrored, mirrored), 1e-30));
    let pixel_seed = hash2(id.x, hash2(id.y, params.seed ^ params.shift));
    let pixel_side = facing_side();
    var sum = vec3f(0.0);
    for (var k = 0u; k < SAMPLES; k += 1u) {
        // Draw a sample, and skip it if it sends no light.
        let number = sequence.index * SAMPLES + k;
        let chosen = lobe_sample(number, pixel_seed, brdf.alpha, forward);
        let place = start.pixel + chosen.offset;
        let inside = all(place >= vec2i(0)) && all(place < size);
        let code = light[params.light_offset + u32(select(0, place.y * size.x + place.x, inside))];
        if (!inside || (code.x | (code.y & 0xffffu)) == 0u) {
            continue;
        }
        // Skip the sample unless both surfaces face each other; `arriving` and `leaving` are cosines times d.
        let texel = textureLoad(surfels, vec2u(place));
        let end = Endpoint(place, surfel_position(texel), surfel_normal(texel));
        let way = end.position - start.position;
        let squared = dot(way, way);
        let arriving = max(dot(normal, way), 0.0);
        let leaving = max(-dot(end.normal, way), 0.0);
        if (arriving * leaving <= 0.0) {
            continue;
        }
        // Add the sample's light, with the form factor of a disc and the widened lobe.
        let facing = leaving * inverseSqrt(squared) * chosen.count * surfel_area(texel, pixel_side);
        let reach = squared + facing * INV_PI;
        let shine = shine_of(brdf, eye_loss, normal, to_eye, way, reach, facing);
        let term = chosen.count * arriving * leaving / max(squared * reach, 1e-37);
        sum += unpack_light(code) * shine.coat * (term * visibility(start, end, number));
    }
    let added = select(glossy[index].rgb, vec3f(0.0), FINEST);
    glossy[index] = vec4f(added + sum / coat_tint(brdf, normal, to_eye), 1.0);
}
