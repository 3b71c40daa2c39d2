// The radiance that a receiver gets from a surface that a search has found.
//
// Only the fronts of senders count. Errs where glossy senders send other light to the receiver than to the camera.
#import "ssdo/hit_code.wgsl"
#import "scene/info.wgsl"

override SENDER_STRIDE: u32 = 2u;  // pixels between senders of sources other than the first layer
override BY_RAYS: bool = false;    // hits of the first layer face the receiver

@group(1) @binding(12) var<storage, read> senders: array<vec4u>;  // of each source, as `senders.wgsl` leaves them

// Returns the index of a hit's sender: all pixels of the first layer come first, then the grids of other sources.
fn sender_index(hit: u32) -> u32 {
    let source = hit_source(hit);
    let pixel = hit_pixel(hit);
    let block = select(source, source - FIRST_CAMERA + LAYERS, source >= FIRST_CAMERA);
    let sender_grid = (view.size + SENDER_STRIDE - 1u) / SENDER_STRIDE;
    let place = pixel / SENDER_STRIDE;
    let first_layer = view.size.x * view.size.y;
    let in_grid = first_layer + ((max(block, 1u) - 1u) * sender_grid.y + place.y) * sender_grid.x + place.x;
    return select(in_grid, pixel.y * view.size.x + pixel.x, block == 0u);
}

// Returns the radiance, W/(m2 sr), that arrives from a hit.
fn radiance_of(hit: u32, arrival: HitDirection) -> vec3f {
    if (arrival.has_light) {
        return unpack_radiance(hit);
    }
    let sender = senders[sender_index(hit)];
    // The sender's front must face the receiver; the angle must be steep at the sender or at the receiver.
    let sender_cosine = -dot(octahedral_decode(unpack2x16snorm(sender.w)), arrival.direction);
    let is_facing = sender_cosine > LEAST_SINE || (sender_cosine > 0.0 && arrival.is_steep)
        || (BY_RAYS && hit_source(hit) == 0u);
    return bitcast<vec3f>(sender.rgb) * select(0.0, arrival.weight, is_facing);
}
