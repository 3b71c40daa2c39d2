// One invocation adds the irradiance that rays bring to an unrepresented pixel from surfaces that no pixel shows.
//
// E = sum rho E_hit / RAYS, E_hit of the radiance cache or, where it has none, of a path. In: list of pixels,
// visibility, cells, scene. Out: irradiance, W/m2. Errs blurry, by the side of a cell; the light is not filtered over
// neighbours, which lie on other surfaces.
#import "scene/sequence.wgsl"
#import "ssil/offscreen/ray.wgsl"
#import "shared/radiance_cache/irradiance.wgsl"
#import "shared/upsample/unrepresented.wgsl"

@group(1) @binding(12) var<storage, read_write> irradiance: array<vec4f>;
@group(1) @binding(19) var<uniform> params: Params;
@group(1) @binding(25) var<storage, read> cells: array<Cell>;

struct Params {
    seed: u32,
}

// Per pixel and frame: their light is not averaged over neighbours, so one ray is too noisy.
const RAYS: u32 = 2u;
// Pairs of random numbers.
const DIRECTION_PAIR: u32 = 0u;
const PLACE_PAIR: u32 = 1u;
const PATH_PAIRS: u32 = 2u;

// Returns the irradiance of a hit.
fn irradiance_at(found: OffscreenHit, index: u32, seed: u32) -> vec3f {
    let cell = find_cell(cell_key(found.surface.position, found.side, sobol_2d(index, hash2(PLACE_PAIR, seed))));
    if (cell != NO_CELL) {
        let known = cells[cell];
        if (updates_of(known.state) > 0u) {
            return known.irradiance;
        }
    }
    return irradiance_by_path(found.surface, index, hash2(PATH_PAIRS, seed));
}

@compute @workgroup_size(LIST_GROUP)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let count = unrepresented_count();
    for (var slot = id.x; slot < count; slot += groups.x * LIST_GROUP) {
        let pixel = unrepresented[slot];
        let start = shown_surface(vec2u(pixel % view.size.x, pixel / view.size.x));
        let frame = frame_from_normal(start.normal);
        let seed = hash2(pixel, params.seed);
        var sum = vec3f(0.0);
        for (var k = 0u; k < RAYS; k += 1u) {
            let index = sequence.index * RAYS + k;
            let local = sample_cosine_hemisphere(sobol_2d(index, hash2(DIRECTION_PAIR, seed)));
            let found = offscreen_hit(start, frame * local);
            if (found.hit.triangle != NONE) {
                sum += found.reflectance * irradiance_at(found, index, seed);
            }
        }
        irradiance[pixel] = vec4f(irradiance[pixel].rgb + sum / f32(RAYS), 1.0);
    }
}
