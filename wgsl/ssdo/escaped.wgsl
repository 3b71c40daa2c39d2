// One invocation adds the environment's light of a pixel's escaped directions, which rays have decided, to its share V
// (`ssdo/search.wgsl`).
//
// V += 1 / N sum_k L(w_k). In: the list of undecided directions, their results in `hits`, the prefiltered environment.
// Out: V, added. Exact.
#import "shared/gbuffer/load.wgsl"
#import "ssdo/directions.wgsl"
#import "ssdo/undecided_list.wgsl"

@group(1) @binding(11) var<storage, read_write> occlusion: array<vec4f>;  // of slots; UNREPRESENTED: of pixels
@group(1) @binding(13) var<storage, read> hits: array<vec2u>;
@group(1) @binding(14) var<storage, read> unoccluded: array<vec4f>;       // with SAMPLE_ENVIRONMENT, by slot
@group(1) @binding(19) var<uniform> params: Params;

struct Params {
    lobe: u32,  // number of the environment's prefiltered map that is L
}

// Adds the light of all listed directions of the pixel whose first one is listed at `place`.
fn add_escaped(place: u32, count: u32) {
    let slot = slot_of(undecided_index(place));
    let pixel = pixel_of_slot(slot);
    let normal = load_surface(pixel).normal;
    let mean = mean_radiance(normal);
    var sum = vec3f(0.0);
    for (var k = 0u; k < DIRECTIONS && place + k < count; k += 1u) {
        let index = undecided_index(place + k);
        if (slot_of(index) != slot || index % (DIRECTIONS + LOBES) >= DIRECTIONS) {
            break;
        }
        let hit = hits[index];
        if (hit.x == NO_HIT) {
            let direction = octahedral_decode(unpack2x16snorm(hit.y));
            sum += radiance_from(direction, mean, params.lobe) * direction_weight(direction, normal);
        }
    }
    var whole = vec3f(f32(max(DIRECTIONS, 1u)));
    if (UNREPRESENTED && SAMPLE_ENVIRONMENT) {
        whole = max(unoccluded[slot].rgb, vec3f(1e-30));
    }
    let place_of_share = select(slot, pixel.y * view.size.x + pixel.x, UNREPRESENTED);
    occlusion[place_of_share] += vec4f(sum / whole, 0.0);
}

@compute @workgroup_size(LIST_GROUP)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let count = undecided_count();
    for (var place = id.x; place < count; place += groups.x * LIST_GROUP) {
        // The first listed direction of a pixel stands for all.
        let is_first = place == 0u || slot_of(undecided_index(max(place, 1u) - 1u)) != slot_of(undecided_index(place));
        if (is_first) {
            add_escaped(place, count);
        }
    }
}
