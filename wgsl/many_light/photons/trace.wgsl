// One invocation sends a photon from a surface along its lobe and leaves its light at the pixels around the point that it hits
// (photon splatting: McGuire and Luebke 2009, "Hardware-Accelerated Global Illumination by Image Space Photon Mapping").
//
// E(q) = sum_j flux_j K(|q - x_j|) / sum_p K(|p - x_j|) A_p, K(d) = 1 - d^2 / r^2 in the picture, over the pixels p, of areas A_p, on
// the photon's surface. r^2 is the photon's share of the
// surface that it left, as magnified on its way, and shrinks over the frames of a still picture (Knaus and Zwicker 2011,
// "Progressive Photon Mapping: A Probabilistic Approach"). In: photons in the layout of VPLs, scene, G-buffer. Out: flux over
// `deposit_unit`, E times the squared width of the pixel; the same for the light of coats. Errs blurry by r.
#import "scene/sequence.wgsl"
#import "scene/surface.wgsl"
#import "scene/trace.wgsl"
#import "common/random.wgsl"
#import "common/lobes.wgsl"
#import "many_light/vpl/table.wgsl"
#import "many_light/vpl/lobe.wgsl"
#import "many_light/gather/receiver.wgsl"
#import "many_light/near_field/share.wgsl"
#import "many_light/photons/deposits.wgsl"

@group(1) @binding(11) var<storage, read_write> deposits: array<atomic<u32>>;       // red, green, blue of each pixel
@group(1) @binding(12) var<storage, read_write> glossy_deposits: array<atomic<u32>>;
@group(1) @binding(19) var<uniform> params: Params;

struct Params {
    count: u32,
    seed: u32,
    least_weight: f32,
    widest: f32,       // alpha of the widest coat that reflects by rays
    near_radius: f32,  // r_max of the near field, heights of the picture
}

const LOBE_PAIR: u32 = 29u;  // of random numbers
// Area of the kernel over the photon's share of the surface that it left.
const SPREAD: f32 = 4.0;
// Pixels of the kernel's radius that are visited; a larger kernel visits some pixels only, at random.
const TAPS: f32 = 3.0;
// Largest stride of visited pixels. The blur closes gaps of this size.
const MOST_STRIDE: f32 = 4.0;
// Distance from a pixel's plane over the kernel's radius, up to which a photon is on the pixel's surface.
const OFF_PLANE: f32 = 0.5;
// Least cosine between a surface and the way to the eye: bounds areas of surfaces seen edge-on.
const LEAST_COSINE: f32 = 0.1;
// Most that a normal map adds to the light of a photon, as in `many_light/vpl/reflect.wgsl`.
const MAX_NORMAL_RATIO: f32 = 4.0;

// A photon where it has hit a surface.
struct Landed {
    position: vec3f,
    direction: vec3f,  // of travel, unit
    side: vec3f,       // geometric normal on the side that it has hit, unit
    flux: vec3f,       // W
    radius: f32,       // of the kernel, metres across the way to the eye
    travelled: f32,    // metres
    near: f32,         // share of its light that the near field finds at distance 0
}

fn add(index: u32, flux: vec3f) {
    let units = vec3u(min(round(flux / deposit_unit()), vec3f(1048576.0)));
    for (var channel = 0u; channel < 3u; channel += 1u) {
        if (units[channel] > 0u) {
            atomicAdd(&deposits[3u * index + channel], units[channel]);
        }
    }
}

fn add_glossy(index: u32, flux: vec3f) {
    let units = vec3u(min(round(flux / deposit_unit()), vec3f(1048576.0)));
    for (var channel = 0u; channel < 3u; channel += 1u) {
        if (units[channel] > 0u) {
            atomicAdd(&glossy_deposits[3u * index + channel], units[channel]);
        }
    }
}

// Returns the geometric normal of a pixel's surface on the side that the camera sees.
fn side_of(r: Receiver) -> vec3f {
    return select(-r.geometric_normal, r.geometric_normal, dot(r.geometric_normal, r.to_eye) > 0.0);
}

// Returns whether the photon has hit a pixel's surface on the side that the camera sees.
fn is_on(r: Receiver, photon: Landed) -> bool {
    let side = side_of(r);
    let off = dot(r.position - photon.position, side);
    let same_side = dot(photon.side, side) >= SIMILAR_NORMALS && dot(photon.direction, side) < 0.0;
    return r.depth > 0.0 && same_side && abs(off) <= OFF_PLANE * photon.radius;
}

// Returns the area of the photon's plane that a pixel shows, m2.
fn pixel_area(pixel: vec2u, r: Receiver) -> f32 {
    // Towards the border of the picture, pixels are seen at an angle.
    let across = squared_width(pixel) * -dot(r.to_eye, view.forward);
    return across / max(dot(side_of(r), r.to_eye), LEAST_COSINE);
}

// Leaves light at a pixel; `share`: of the photon's flux.
fn leave_at(pixel: vec2u, r: Receiver, photon: Landed, share: f32) {
    let geometric = -dot(photon.direction, side_of(r));
    let shading = max(-dot(photon.direction, r.normal), 0.0);
    let flux = photon.flux * (share * min(shading / max(geometric, 1e-6), MAX_NORMAL_RATIO));
    let index = pixel.y * view.size.x + pixel.x;
    let squared = photon.travelled * photon.travelled;
    let far = far_field_share(photon.near, squared, r.near_radius);
    if (!HAS_COATS) {
        add(index, flux * far);
        return;
    }
    // Split the light between the coat and the base.
    let shine = shine_of(
        r.brdf, r.eye_loss, r.normal, r.to_eye, -photon.direction, squared, PI * photon.radius * photon.radius);
    add(index, flux * (far * shine.transmitted));
    if (r.brdf.glossy && lobe_width(r.brdf) > params.widest) {
        add_glossy(index, flux * shine.coat / coat_tint(r.brdf, r.normal, r.to_eye));
    }
}

// The pixels around a photon that get its light: all within `reach` of it, or a random one of each square of `stride`.
struct Footprint {
    place: vec2f,   // of the photon in the whole picture, pixels
    reach: f32,     // pixels
    centre: vec2i,
    stride: i32,
    taps: i32,      // on each side of the centre
}

// Returns whether this picture has a pixel of the whole picture.
fn is_in_window(pixel: vec2i) -> bool {
    return all(pixel >= vec2i(view.corner)) && all(pixel < vec2i(view.corner + view.size));
}

// Returns the kernel at a pixel of the whole picture.
fn kernel_at(f: Footprint, pixel: vec2i) -> f32 {
    let away = (vec2f(pixel) + 0.5 - f.place) / f.reach;
    let inside = is_in_window(pixel);
    return select(0.0, max(1.0 - dot(away, away), 0.0), inside);
}

// Returns the sum of the kernel over the areas of the pixels.
fn kernel_sum(f: Footprint, photon: Landed) -> f32 {
    var sum = 0.0;
    for (var y = -f.taps; y <= f.taps; y += 1) {
        for (var x = -f.taps; x <= f.taps; x += 1) {
            let pixel = f.centre + vec2i(x, y) * f.stride;
            let kernel = kernel_at(f, pixel);
            if (kernel > 0.0) {
                let own = vec2u(pixel) - view.corner;
                let r = load_receiver(own, params.near_radius);
                sum += select(0.0, kernel * pixel_area(own, r), is_on(r, photon));
            }
        }
    }
    return sum;
}

// Leaves the light of a photon at the pixels of its footprint; `sum`: of `kernel_sum`.
fn leave_all(f: Footprint, photon: Landed, sum: f32) {
    for (var y = -f.taps; y <= f.taps; y += 1) {
        for (var x = -f.taps; x <= f.taps; x += 1) {
            let pixel = f.centre + vec2i(x, y) * f.stride;
            let kernel = kernel_at(f, pixel);
            if (kernel > 0.0) {
                let own = vec2u(pixel) - view.corner;
                let r = load_receiver(own, params.near_radius);
                if (is_on(r, photon)) {
                    leave_at(own, r, photon, kernel * squared_width(own) / sum);
                }
            }
        }
    }
}

// Returns whether the camera sees a photon: it does not lie behind the plane of what the photon's pixel shows.
fn is_seen(place: vec2f, photon: Landed) -> bool {
    if (any(place < vec2f(0.0)) || !is_in_window(vec2i(floor(place)))) {
        return false;
    }
    let r = load_receiver(vec2u(place) - view.corner, params.near_radius);
    return r.depth <= 0.0 || dot(photon.position - r.position, side_of(r)) > -OFF_PLANE * photon.radius;
}

// Leaves the light of a photon at the pixels within its kernel.
fn splat(landed: Landed, random: u32) {
    // Find its place in the picture.
    let clip = view.clip_from_world * vec4f(landed.position, 1.0);
    let place = (clip.xy / max(clip.w, 1e-37) * vec2f(0.5, -0.5) + 0.5) * vec2f(view.whole);
    let depth = select(dot(landed.position - view.position, view.forward), 1.0, view.orthographic != 0u);
    // A kernel as wide as a pixel finds at least one.
    let width = 2.0 * length(view.up) * depth / f32(view.whole.y);
    let reach = clamp(landed.radius / max(width, 1e-37), 1.0, TAPS * MOST_STRIDE);
    var photon = landed;
    photon.radius = reach * width;
    if (clip.w <= 0.0 || depth <= 0.0 || !is_seen(place, photon)) {
        return;
    }
    // Share its light among the pixels, so that none is lost at the edges of surfaces.
    let stride = i32(ceil(reach / TAPS));
    let taps = i32(ceil(reach / f32(stride)));
    let phase = vec2i(vec2u(random & 0xffffu, random >> 16u) % u32(stride)) - stride / 2;
    let footprint = Footprint(place, reach, vec2i(floor(place)) + phase, stride, taps);
    let sum = kernel_sum(footprint, photon);
    if (sum > 0.0) {
        leave_all(footprint, photon, sum);
    }
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (id.x >= params.count) {
        return;
    }
    let v = load_vpl_with_lobe(id.x);
    if (v.lobe.roughness <= 0.0 || max3(v.lobe.arriving) <= 0.0) {
        return;
    }
    // Send the photon.
    let index = id.x + sequence.index * params.count;
    let sent = send_by_lobe(v, sobol_2d(index, hash2(LOBE_PAIR, params.seed)));
    let flux = sent.flux * photon_share(v, sent.direction);
    let start = v.position + v.normal * ray_offset(v.normal, surface_terms(v.position));
    if (max3(flux) <= 0.0) {
        return;
    }
    let hit = trace(Ray(start, sent.direction), FLOAT_MAX);
    if (hit.triangle == NONE) {
        return;
    }
    // Spread its light over its share of the surface that it left, as the curvature of its light's waves magnifies it.
    let s = surface_at(hit, sent.direction);
    let magnified = 1.0 + hit.distance * v.lobe.nearness;
    let across = v.area * max(dot(v.normal, sent.direction), 0.0) * magnified * magnified;
    let area = SPREAD * across * inverseSqrt(f32(sequence.still + 1u));
    var near = 0.0;
    if (NEAR_FIELD) {
        near = near_share_of(v.position, v.normal);
    }
    let side = select(-s.geometric_normal, s.geometric_normal, s.front);
    let landed = Landed(s.position, sent.direction, side, flux * hit.tint, sqrt(area * INV_PI), hit.distance, near);
    splat(landed, hash2(id.x, hash2(sequence.index, params.seed)));
}
