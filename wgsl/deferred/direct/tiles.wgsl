// One workgroup finds the lights that can reach a tile of 16x16 pixels (Olsson and Assarsson 2011, "Tiled Shading").
//
// A tile is the bounding box of its visible positions. In: distance, lights. Out: a bit per light for each tile.
// Conservative: a light is culled only where its contribution is exactly zero (beyond its range, outside its cone,
// behind its emitter), so the picture does not change, bit for bit.
#import "scene/info.wgsl"
#import "deferred/shadow/table.wgsl"
#import "deferred/direct/tile.wgsl"

@group(1) @binding(11) var<storage, read_write> tile_lights: array<u32>;
@group(1) @binding(31) var distance: texture_2d<f32>;

const THREADS: u32 = TILE * TILE;
// Widens the box relative to its coordinates, by more than the lighting tests round: at most 100 operations of 2^-24.
const ROUNDING: f32 = 1e-5;

var<workgroup> low: array<vec3f, THREADS>;
var<workgroup> high: array<vec3f, THREADS>;
var<workgroup> light_count: u32;
var<workgroup> words: array<atomic<u32>, 8>;   // of THREADS lights

fn reaches(light: DirectLight, centre: vec3f, half: vec3f) -> bool {
    if (light.kind == DIRECT_SUN) {
        return true;
    }
    let offset = centre - light.position;
    // Offset of the nearest point of the box.
    let outside = max(abs(offset) - half, vec3f(0.0));
    if (length(outside) * light.inverse_range > 1.0) {
        return false;
    }
    if (light.kind == DIRECT_POINT) {
        return true;
    }
    let reach = dot(abs(light.direction), half);
    if (light.kind == DIRECT_AREA) {
        return light.both_sides != 0u || dot(light.direction, offset) + reach >= 0.0;
    }
    // Test the sphere around the box against the cone at which the fall-off ends, at the versine offset / scale.
    let versine = light.cone_offset / light.cone_scale;
    let edge = 1.0 - versine;
    let radius = length(half);
    let along = dot(light.direction, offset);
    let aside = length(offset - light.direction * along);
    let sine = sqrt(max(versine * (2.0 - versine), 0.0));
    // Distance of the sphere's centre from the cone's surface, within the plane through its axis.
    return edge <= 0.0 || dot(offset, offset) <= radius * radius || aside * edge - along * sine <= radius;
}

@compute @workgroup_size(TILE, TILE)
fn main(
    @builtin(global_invocation_id) id: vec3u, @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) thread: u32
) {
    if (thread == 0u) {
        light_count = load_light_count();
    }
    // Reduce the positions of the tile to their box.
    var seen = 0.0;
    if (all(id.xy < view.size)) {
        seen = textureLoad(distance, id.xy, 0).r;
    }
    let ray = pixel_ray(id.xy);
    let position = ray.origin + ray.direction * seen;
    low[thread] = select(vec3f(FLOAT_MAX), position, seen > 0.0);
    high[thread] = select(vec3f(-FLOAT_MAX), position, seen > 0.0);
    for (var step = THREADS / 2u; step > 0u; step /= 2u) {
        workgroupBarrier();
        if (thread < step) {
            low[thread] = min(low[thread], low[thread + step]);
            high[thread] = max(high[thread], high[thread + step]);
        }
    }
    workgroupBarrier();
    let is_empty = low[0].x > high[0].x;
    let centre = select((low[0] + high[0]) * 0.5, vec3f(0.0), is_empty);
    let half = (high[0] - low[0]) * 0.5 + (abs(low[0]) + abs(high[0])) * ROUNDING;

    // Each thread tests every 256th light. The count is uniform, so all threads reach the barriers.
    let count = workgroupUniformLoad(&light_count);
    let word_count = (count + 31u) / 32u;
    let tile = group.y * groups.x + group.x;
    for (var first = 0u; first < count; first += THREADS) {
        if (thread < 8u) {
            atomicStore(&words[thread], 0u);
        }
        workgroupBarrier();
        let light = first + thread;
        if (light < count && !is_empty) {
            if (reaches(load_light(light), centre, half)) {
                atomicOr(&words[thread / 32u], 1u << (thread % 32u));
            }
        }
        workgroupBarrier();
        let word = first / 32u + thread;
        if (thread < 8u && word < word_count) {
            tile_lights[tile * word_count + word] = atomicLoad(&words[thread]);
        }
        workgroupBarrier();
    }
}
