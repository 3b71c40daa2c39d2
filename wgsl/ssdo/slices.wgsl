// One invocation computes, from slices of a receiver's hemisphere, the share of the environment's light that reaches
// it, V = 1 / N sum_i sum_j m L_ij / mean(L) over the free sectors j of slices i, of equal measure m; or, with GATHER,
// what surfaces reflect to it, E = pi / N sum_i sum_a m_ia L(q_ia) over the covered arcs a of slices i, each with its
// share m_ia of the slice's measure and the surface q_ia that it sees.
//
// Therrien, Levesque and Gilet 2023, "Screen Space Indirect Lighting with Visibility Bitmask"; departures: those of
// `ssdo/slice_march.wgsl`. The pixels of an n x n square share a stratified set of slices, and the following blur
// averages over such squares. For V, L is the environment filtered to about the solid angle of an arc that it is looked
// up for. With LISTS the pass also draws directions from the sectors that no picture decides, RAYS for a slice that is
// all undecided. In: G-buffer, depths, the prefiltered environment or the radiance of senders, W/(m2 sr). Out: V, whose
// mean is 1 without occluders, or the irradiance E, W/m2, with the depth of `shared/denoise/plane.wgsl`, 0 where there
// is nothing to light; undecided directions, in `hits`. Without LISTS it errs as if sectors that no picture decides
// were free, and those behind a surface covered.
#import "shared/gbuffer/tiles.wgsl"
#import "shared/denoise/plane.wgsl"
#import "ssdo/directions.wgsl"
#import "ssdo/slice_march.wgsl"
#import "ssdo/undecided.wgsl"
#import "ssdo/sender_light.wgsl"
#import "shared/upsample/grid_pixel.wgsl"
#import "shared/upsample/unrepresented.wgsl"
#import "common/coat.wgsl"

override GATHER: bool = false;         // compute E
override LISTS: bool = false;          // list undecided directions; needs KNOWN
override RAYS: u32 = 1u;
override UNREPRESENTED: bool = false;  // process unrepresented pixels only
override STORED: bool = true;          // store V or E of unrepresented pixels
override REFLECTED: bool = false;      // for E of unrepresented pixels, store radiance: rho E / pi, W/(m2 sr)

@group(1) @binding(11) var<storage, read_write> result: array<vec4f>;  // V or E
@group(1) @binding(14) var<storage, read_write> normals: array<u32>;
@group(1) @binding(13) var<storage, read_write> hits: array<vec2u>;  // packed by `ssdo/hit_code.wgsl`
@group(1) @binding(19) var<uniform> params: Params;

struct Params {
    seed: u32,
    lobe: u32,    // number of the environment's prefiltered map that is L
    radius: f32,  // largest r_max, in heights of the picture at the receiver
}

// Arcs of a slice for which the environment is looked up.
const LOOKUPS: u32 = 8u;

var<private> gathered: vec3f;  // with GATHER: L times share of covered arcs
var<private> receiver: Receiver;
var<private> receiver_brdf: Brdf;

// Adds the light of a covered arc.
fn see(hit: u32, direction: vec3f, share: f32) {
    if (!GATHER) {
        return;
    }
    let is_steep = dot(receiver.normal, direction) > LEAST_SINE;
    var light = radiance_of(hit, HitDirection(direction, share, is_steep, false));
    if (HAS_COATS) {
        light *= transmitted_from(receiver_brdf, receiver.normal, direction, -receiver.ray.direction);
    }
    gathered += light;
}

// Returns the environment's light in the free sectors of a slice, over its mean on the hemisphere.
fn light_of_free(m: March, mean: vec3f) -> vec3f {
    let free = ~(m.covered | m.undecided);
    if (!HAS_ENVIRONMENT || !HAS_PICTURED_ENVIRONMENT || !DIRECTIONAL) {
        return vec3f(f32(countOneBits(free)) * (1.0 / f32(SECTORS)));
    }
    var sum = vec3f(0.0);
    for (var k = 0u; k < LOOKUPS; k += 1u) {
        let angles = m.slice.tilt + PI * ((f32(k) + vec3f(0.0, 0.5, 1.0)) / f32(LOOKUPS) - 0.5);
        let c = cos(angles);
        let s = sin(angles);
        let arc = sectors_between(m, share_up_to(m.slice, c.x, s.x), share_up_to(m.slice, c.z, s.z));
        let light = radiance_from(c.y * m.slice.axis + s.y * m.slice.tangent, mean, params.lobe);
        sum += light * (f32(countOneBits(arc & free)) * (1.0 / f32(SECTORS)));
    }
    return sum;
}

// Returns the position of set bit `number` of a word.
fn position_of_bit(bits: u32, number: u32) -> u32 {
    var position = 0u;
    var rest = number;
    for (var width = 16u; width > 0u; width /= 2u) {
        let below = countOneBits((bits >> position) & ((1u << width) - 1u));
        let is_above = rest >= below;
        rest -= select(0u, below, is_above);
        position += select(0u, width, is_above);
    }
    return position;
}

// Stores directions of a slice's undecided sectors in its RAYS entries of `hits`, from `first` on: those at every
// (SECTORS / RAYS)-th sector, from a random one on, so each stands for 1 / RAYS of the slice. Returns how many there
// are.
fn store_undecided(m: March, first: u32, number: f32) -> u32 {
    let spacing = f32(SECTORS) / f32(RAYS);
    let count = f32(countOneBits(m.undecided));
    var stored = 0u;
    for (var k = 0u; k < RAYS; k += 1u) {
        let at = (f32(k) + number) * spacing;
        let is_undecided = at < count;
        let sector = position_of_bit(m.undecided, u32(at));
        let low = select((f32(sector) - m.border) / f32(SECTORS), 0.0, sector == 0u);
        let high = select((f32(sector) + 1.0 - m.border) / f32(SECTORS), 1.0, sector == SECTORS - 1u);
        let angle = slice_angle(m.slice, mix(low, high, fract(at)));
        let direction = cos(angle) * m.slice.axis + sin(angle) * m.slice.tangent;
        hits[first + k] = vec2u(
            select(NO_HIT, UNKNOWN_HIT, is_undecided), pack2x16snorm(octahedral_encode(direction)));
        stored += select(0u, 1u, is_undecided);
    }
    return stored;
}

// Lists a pixel's undecided directions. `first`: the first of its entries in `hits`.
fn list_undecided_of(first: u32, count: u32) {
    var place = reserve_undecided(count, SLICES * RAYS);
    for (var k = 0u; k < SLICES * RAYS && count > 0u; k += 1u) {
        if (hits[first + k].x == UNKNOWN_HIT) {
            list_undecided(place, first + k);
            place += 1u;
        }
    }
}

// Marches along the slices of a pixel. `slot`: index of the results; `grid`: the pixel's place in the grid.
fn march_pixel(pixel: vec2u, slot: u32, grid: vec2u) {
    let r = load_receiver(pixel, params.radius);
    if (!r.is_lit) {
        return;
    }
    receiver = r;
    receiver_brdf = gbuffer_brdf(load_surface(pixel));
    gathered = vec3f(0.0);
    var share = vec3f(0.0);
    var undecided_count = 0u;
    let mean = mean_radiance(r.normal);
    for (var i = 0u; i < SLICES; i += 1u) {
        let numbers = slice_numbers(grid, i, params.seed);
        let m = march_slice(r, numbers);
        if (!GATHER) {
            share += light_of_free(m, mean) * (1.0 / f32(SLICES));
        }
        if (LISTS) {
            undecided_count += store_undecided(m, (slot * SLICES + i) * RAYS, numbers.further);
        }
    }
    if (LISTS) {
        list_undecided_of(slot * SLICES * RAYS, undecided_count);
    }
    let irradiance = gathered * (PI / f32(SLICES));
    let found = select(share, irradiance, GATHER);
    let depth = plane_depth(r.ray, r.seen);
    if (UNREPRESENTED) {
        if (STORED) {
            let factor = select(vec3f(1.0), receiver_brdf.diffuse * INV_PI, REFLECTED);
            result[pixel.y * view.size.x + pixel.x] = vec4f(found * factor, select(depth, 1.0, GATHER));
        }
        return;
    }
    result[slot] = vec4f(found, depth);
    normals[slot] = pack_view_normal(r.normal);
}

// Runs per pixel of a tile that shows a surface.
@compute @workgroup_size(8, 8)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) thread: vec3u) {
    let pixel = pixel_of_tile(group, thread, view.size);
    if (all(pixel < view.size)) {
        march_pixel(pixel, pixel.y * view.size.x + pixel.x, pixel);
    }
}

// Runs per pixel of a coarser grid.
@compute @workgroup_size(8, 8)
fn coarse(@builtin(global_invocation_id) id: vec3u) {
    if (all(id.xy < grid_size())) {
        march_pixel(grid_pixel(id.xy), id.y * grid_size().x + id.x, id.xy);
    }
}

// Runs per unrepresented pixel.
@compute @workgroup_size(LIST_GROUP)
fn listed(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let count = unrepresented_count();
    for (var slot = id.x; slot < count; slot += groups.x * LIST_GROUP) {
        let index = unrepresented[slot];
        let pixel = vec2u(index % view.size.x, index / view.size.x);
        march_pixel(pixel, slot, pixel);
    }
}
