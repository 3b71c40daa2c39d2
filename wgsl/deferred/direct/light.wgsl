// One invocation computes a pixel's direct light, with filtered shadow maps.
//
// L = sum_i f_r(w_o, w_i) E_i cos_i V_i, plus `sky`, the light of the environment. In: G-buffer, lights, shadow maps,
// prefiltered environment. Out: direct, W/(m2 sr), cleared before; the pixels whose shadow filter is
// undecided, for `edges.wgsl`. Errs bright by the filter's bias and, without `sky`, where the environment is occluded.
#import "shared/gbuffer/load.wgsl"
#import "shared/gbuffer/tiles.wgsl"
#import "deferred/direct/lighting.wgsl"
#import "deferred/direct/tile.wgsl"
#import "deferred/environment/ambient.wgsl"
#import "ssdo/contact.wgsl"

override TILED: bool = false;     // tiles have lists of the lights that reach them
override FEW: u32 = 0u;           // number of lights if it is at most 3, else 0
override EDGES: bool = true;      // list the undecided pixels
override SKY: bool = false;       // `sky` has the environment's light, occluded
override CONTACTS: bool = false;  // search the picture for shadows that the filter's bias lost

@group(1) @binding(11) var<storage, read_write> direct: array<vec4f>;
@group(1) @binding(12) var<storage, read_write> edges: array<u32>;                // pixels, by their index
@group(1) @binding(13) var<storage, read_write> edge_groups: array<atomic<u32>>;  // x, y, z workgroups; pixels
@group(1) @binding(14) var<storage, read> tile_lights: array<u32>;                // a bit for each light, by tile
@group(1) @binding(15) var<storage, read> sky: array<vec4f>;                      // W/(m2 sr)

// Largest number of workgroups of `edges.wgsl`; in longer lists each thread takes several pixels. 2^18 threads fill any
// GPU.
const MAX_EDGE_GROUPS: u32 = 4096u;

struct Sum {
    radiance: vec3f,
    undecided: bool,
}

fn add_light(sum: Sum, number: u32, count: u32, r: Receiver) -> Sum {
    let light = load_light(number);
    let incident = light_at(light, r.position);
    let radiance = reflected(r, incident);
    if (max3(radiance) <= 0.0) {
        return sum;
    }
    if (!EDGES) {
        var lit = shadow_filter(light, count, r.position, r.geometric_normal, incident.direction);
        if (CONTACTS && lit > 0.0) {
            let bias = shadow_bias(light, count, r.position, r.geometric_normal, incident.direction);
            lit *= contact_visibility(r.position, r.geometric_normal, incident.direction, bias);
        }
        return Sum(sum.radiance + lit * radiance, false);
    }
    let lit = shadow_verdict(light, count, r.position, r.geometric_normal, incident.direction).lit;
    return Sum(sum.radiance + max(lit, 0.0) * radiance, sum.undecided || lit == UNDECIDED);
}

@compute @workgroup_size(8, 8)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) thread: vec3u) {
    let pixel = pixel_of_tile(group, thread, view.size);
    if (any(pixel >= view.size)) {
        return;
    }
    let index = pixel.y * view.size.x + pixel.x;
    let distance_seen = load_distance(pixel);
    if (distance_seen <= 0.0) {
        return;
    }
    let surface = load_surface(pixel);
    if ((surface.flags & GBUFFER_UNLIT) != 0u) {
        return;
    }
    let ray = pixel_ray(pixel);
    let r = receiver(
        ray.origin + ray.direction * distance_seen, surface.normal, surface.geometric_normal, gbuffer_brdf(surface),
        -ray.direction);
    var ambient: vec3f;
    if (SKY) {
        ambient = sky[index].rgb;
    } else {
        ambient = ambient_radiance(r.brdf, r.normal, -ray.direction);
    }
    var sum = Sum(ambient, false);
    let count = load_light_count();
    if (TILED) {
        let tile = (pixel.y / TILE) * ((view.size.x + TILE - 1u) / TILE) + pixel.x / TILE;
        for (var word = 0u; 32u * word < count; word += 1u) {
            var bits = tile_lights[tile * ((count + 31u) / 32u) + word];
            while (bits != 0u) {
                sum = add_light(sum, 32u * word + firstTrailingBit(bits), count, r);
                bits &= bits - 1u;
            }
        }
    } else if (FEW > 0u) {
        // Unrolled: CPU drivers load from constant addresses almost for free, while loops cost them much.
        sum = add_light(sum, 0u, count, r);
        if (FEW > 1u) {
            sum = add_light(sum, 1u, count, r);
        }
        if (FEW > 2u) {
            sum = add_light(sum, 2u, count, r);
        }
    } else {
        for (var number = 0u; number < count; number += 1u) {
            sum = add_light(sum, number, count, r);
        }
    }
    direct[index] = vec4f(sum.radiance, 1.0);
    if (EDGES && sum.undecided) {
        let slot = atomicAdd(&edge_groups[3], 1u);
        edges[slot] = index;
        atomicMax(&edge_groups[0], min(slot / EDGE_GROUP + 1u, MAX_EDGE_GROUPS));
        atomicStore(&edge_groups[1], 1u);
        atomicStore(&edge_groups[2], 1u);
    }
}
