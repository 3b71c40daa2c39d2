// One invocation adds to a pixel's irradiance the light that the bound of near VPLs removes, from nearby surfaces in
// screen space (Novak et al. 2011, "Screen-Space Bias Compensation").
//
// E(x) = integral B(y) / pi cos_x cos_y / d^2 b / (d^2 + b) dA(y): the part of the geometry term that bounded VPLs
// lack, with the mean bound b of the VPLs that light x. Pixels y have the density 1 / (pi^2 R^2 r (r^2 + 1)) over the
// picture, r = |y - x| / R, R = sqrt(b) in pixels at x. The pixels of a square share a stratified set of offsets, which
// the blur averages. In: G-buffer, direct light, W/(m2 sr), gathered irradiance, W/m2, sums of bounds, m2. Out:
// irradiance, W/m2. Errs dark where near surfaces are not in the picture and in corners where R is few pixels, bright
// where an occluder stands between x and y, either way as b differs from the bounds of single VPLs.
#import "scene/sequence.wgsl"
#import "shared/gbuffer/load.wgsl"
#import "shared/denoise/plane.wgsl"
#import "many_light/gather/classes.wgsl"
#import "common/coat.wgsl"
#import "many_light/gather/near_field.wgsl"
#import "common/random.wgsl"

override MULTIPLE_BOUNCES: bool = true;  // y reflects indirect light, too

@group(1) @binding(11) var<storage, read> direct: array<vec4f>;
@group(1) @binding(12) var<storage, read> gathered: array<vec4f>;     // with the depth of `shared/denoise/plane.wgsl`
@group(1) @binding(13) var<storage, read> normals: array<u32>;        // of `shared/denoise/plane.wgsl`
@group(1) @binding(14) var<storage, read> bound_sums: array<vec2f>;
@group(1) @binding(15) var<storage, read_write> irradiance: array<vec4f>;
@group(1) @binding(19) var<uniform> params: Params;

struct Params {
    seed: u32,
    near_radius: f32,  // r_max of the near field, heights of the picture
}

const SQUARE: u32 = 16u;            // pixels that share a set: INTERLEAVE^2
const SAMPLES: u32 = 4u;            // pixels y; tools/README.md, "Constants"
// Share of a pixel's area that bounds its light, like BOUND_SHARE for a VPL's area.
const OWN_SHARE: f32 = 0.25;
const COMPENSATION_PAIR: u32 = 7u;  // of random numbers

// Offsets of the pixels of a square and their lengths r, over R.
var<workgroup> offsets: array<vec3f, SQUARE * SAMPLES>;

// The surface that a pixel shows, in the camera's frame: right, up, forward.
struct PixelSurface {
    position: vec3f,
    normal: vec3f,
    area: f32,       // within the pixel, m2
    width: f32,      // of the pixel at its depth, m
}

// Returns the surface of a pixel whose depth is above 0.
fn surface_of_pixel(pixel: vec2u, depth: f32) -> PixelSurface {
    let half = vec2f(length(view.right), length(view.up));
    let size = vec2f(view.size);
    let place = ((vec2f(pixel) + view.offset) / size * vec2f(2.0, -2.0) + vec2f(-1.0, 1.0)) * half;
    let parallel = view.orthographic != 0u;
    let scale = select(1.0 / max(depth, 1e-37), 1.0, parallel);
    let along = select(vec3f(place, 1.0), vec3f(0.0, 0.0, 1.0), parallel);
    let normal = unpack_view_normal(normals[pixel.y * view.size.x + pixel.x]);
    let widths = 2.0 * half / size * scale;
    return PixelSurface(
        select(vec3f(place, 1.0) * scale, vec3f(place, depth), parallel), normal,
        widths.x * widths.y / max(abs(dot(along, normal)), 0.1), widths.x);
}

// Returns the irradiance at x from the surface of a pixel y that bounded VPLs lack, W/m2.
fn lost_light(at: PixelSurface, brdf: Brdf, bound: f32, y: vec2u) -> vec3f {
    let index = y.y * view.size.x + y.x;
    let light = gathered[index];
    if (light.w <= 0.0) {
        return vec3f(0.0);
    }
    let other = surface_of_pixel(y, light.w);
    let way = other.position - at.position;
    let squared = dot(way, way);
    let cosines = max(dot(way, at.normal), 0.0) * max(-dot(way, other.normal), 0.0);
    if (cosines <= 0.0) {
        return vec3f(0.0);
    }
    // Bound the light of the pixel's area, like a VPL's, and take the part that bounded VPLs lack.
    let own = squared + OWN_SHARE * INV_PI * other.area;
    var term = cosines * other.area * bound / max(squared * own * (squared + bound), 1e-37);
    // Find the radiosity of y over pi, and the share that x's coat transmits.
    var reflected = direct[index].rgb;
    if (MULTIPLE_BOUNCES) {
        reflected += light.rgb * gbuffer_brdf(load_surface(y)).diffuse * INV_PI;
    }
    if (HAS_COATS) {
        let to_eye = select(-normalize(at.position), vec3f(0.0, 0.0, -1.0), view.orthographic != 0u);
        reflected *= transmitted_from(brdf, at.normal, way, to_eye);
    }
    // Leave out the light that the near field finds.
    if (NEAR_FIELD) {
        let radius = search_radius_at_depth(at.position.z, params.near_radius);
        term *= 1.0 - border_fade(vec2f(y) + 0.5, vec2f(view.size)) * distance_fade(radius, sqrt(squared));
    }
    return reflected * term;
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(local_invocation_index) thread: u32) {
    // Draw an offset per thread. Lengths have the distribution 2 / pi atan(r).
    let u = sobol_2d(sequence.index * SQUARE * SAMPLES + thread, hash2(COMPENSATION_PAIR, params.seed));
    let radius = tan(0.5 * PI * min(u.x, 0.999));
    offsets[thread] = vec3f(radius * cos(TWO_PI * u.y), radius * sin(TWO_PI * u.y), radius);
    workgroupBarrier();
    if (any(id.xy >= view.size)) {
        return;
    }
    let index = id.y * view.size.x + id.x;
    let found = gathered[index];
    let sums = bound_sums[index];
    if (found.w <= 0.0 || sums.y <= 0.0) {
        irradiance[index] = found;
        return;
    }
    let at = surface_of_pixel(id.xy, found.w);
    let brdf = gbuffer_brdf(load_surface(id.xy));
    let bound = sums.x / sums.y;
    // R is at least a pixel: nearer surfaces cannot be found.
    let reach = max(sqrt(bound) / at.width, 1.0);
    // Sum over this pixel's part of the set in this frame.
    let first = class_of(id.xy, sequence.index) * SAMPLES;
    var sum = vec3f(0.0);
    for (var k = 0u; k < SAMPLES; k += 1u) {
        let offset = offsets[first + k];
        let place = floor(vec2f(id.xy) + 0.5 + reach * offset.xy);
        if (all(place >= vec2f(0.0)) && all(place < vec2f(view.size))) {
            // 1 / density.
            let weight = PI * PI * reach * reach * offset.z * (offset.z * offset.z + 1.0);
            sum += lost_light(at, brdf, bound, vec2u(place)) * weight;
        }
    }
    irradiance[index] = vec4f(found.rgb + sum / f32(SAMPLES), found.w);
}
