// One invocation adds up the light that the surfaces around a pixel's own reflect to it: E = pi / N sum_k L(q_k), over
// the directions that meet a surface.
//
// Ritschel et al. 2009, section 3: L_pixel cos_s cos_r A / d^2. Departure: A is the area that the direction's own solid
// angle dw cuts out of the sender, A = dw d^2 / cos_s, where the paper has pi r_max^2 / N times a strength set by hand:
// what leaves the environment's light out brings in just as much of the sender's, and near senders need no clamp. With
// directions drawn by the cosine, cos_r dw is pi / N. Senders count by their front; coats let 1 - F through. In: hits,
// what senders reflect, W/(m2 sr). Out: irradiance, W/m2, and the depth of `shared/denoise/plane.wgsl`. Errs dark where
// senders are in no picture.
#import "shared/gbuffer/load.wgsl"
#import "shared/gbuffer/tiles.wgsl"
#import "ssdo/hit.wgsl"
#import "ssdo/grid.wgsl"
#import "shared/upsample/unrepresented.wgsl"
#import "common/coat.wgsl"

override DIRECTIONS: u32 = 1u;
override REFLECTED: bool = false;   // unrepresented pixels get radiance
override WEIGHT: f32 = 1.0;         // of a direction at most
override SENDER_STRIDE: u32 = 2u;  // of the grid of sources other than the picture

@group(1) @binding(11) var<storage, read> hits: array<vec2u>;  // a hit and the way there
@group(1) @binding(12) var<storage, read> senders: array<vec4u>;  // of each source, as `senders.wgsl` leaves them
@group(1) @binding(13) var<storage, read_write> irradiance: array<vec4f>;
@group(1) @binding(14) var<storage, read> found: array<vec4f>;  // in w the depth of `shared/denoise/plane.wgsl`

// Returns where a hit's sender is: all pixels of the picture come first, then those of each other source's grid.
fn sender_of(hit: u32) -> u32 {
    let source = source_of_hit(hit);
    let at = pixel_of_hit(hit);
    let block = select(source, source - FIRST_CAMERA + LAYERS, source >= FIRST_CAMERA);
    let coarse = (view.size + SENDER_STRIDE - 1u) / SENDER_STRIDE;
    let place = at / SENDER_STRIDE;
    let pixels = view.size.x * view.size.y;
    let further = pixels + ((max(block, 1u) - 1u) * coarse.y + place.y) * coarse.x + place.x;
    return select(further, at.y * view.size.x + at.x, block == 0u);
}

// Returns the irradiance of a pixel, W/m2; `slot` is where its hits are kept.
fn gather(pixel: vec2u, slot: u32) -> vec3f {
    var sum = vec3f(0.0);
    for (var k = 0u; k < DIRECTIONS; k += 1u) {
        let hit = hits[slot * DIRECTIONS + k];
        if (hit.x == NO_HIT) {
            continue;
        }
        let way = unpack_way(hit.y);
        let sender = senders[sender_of(hit.x)];
        let leaves = -dot(octahedral_decode(unpack2x16snorm(sender.w)), way.direction);
        let faces = leaves > FLAT || (leaves > 0.0 && way.steep);
        var arriving = bitcast<vec3f>(sender.rgb) * select(0.0, way.share, faces);
        if (HAS_COATS) {
            arriving *= passed_share(gbuffer_brdf(load_surface(pixel)), way.direction, -pixel_ray(pixel).direction);
        }
        sum += arriving;
    }
    return sum * (PI * WEIGHT / f32(DIRECTIONS));
}

fn gather_of_grid(grid: vec2u) {
    let index = grid.y * grid_size().x + grid.x;
    let depth = found[index].w;
    if (depth > 0.0) {
        irradiance[index] = vec4f(gather(grid * STRIDE, index), depth);
    }
}

// For each pixel of a seen tile.
@compute @workgroup_size(8, 8)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) thread: vec3u) {
    let pixel = pixel_of_tile(group, thread, view.size);
    if (all(pixel < view.size)) {
        gather_of_grid(pixel);
    }
}

// For each pixel of a coarser grid.
@compute @workgroup_size(8, 8)
fn coarse(@builtin(global_invocation_id) id: vec3u) {
    if (all(id.xy < grid_size())) {
        gather_of_grid(id.xy);
    }
}

// For each unrepresented pixel: irradiance, or with REFLECTED the radiance rho E / pi, W/(m2 sr).
@compute @workgroup_size(LIST_GROUP)
fn listed(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let count = unrepresented_count();
    for (var slot = id.x; slot < count; slot += groups.x * LIST_GROUP) {
        let index = unrepresented[slot];
        let pixel = vec2u(index % view.size.x, index / view.size.x);
        let factor = select(vec3f(1.0), gbuffer_brdf(load_surface(pixel)).diffuse * INV_PI, REFLECTED);
        irradiance[index] = vec4f(gather(pixel, slot) * factor, 1.0);
    }
}
