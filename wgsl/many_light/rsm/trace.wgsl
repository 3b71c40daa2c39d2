// One invocation finds the surface and the reflected flux of a texel of a reflective shadow map (Dachsbacher and
// Stamminger 2005, "Reflective Shadow Maps"; Linke 2016, section 3.2).
//
// flux = light's power in the texel * reflectance, W. Texels of point and spot lights have equal solid angles, those of
// directional lights equal areas across the rays. In: scene, lights. Out: candidates as `vpl/vpl.wgsl` packs them, in
// the order of `rsm/layout.wgsl`; black where a ray leaves the scene. Unbiased if jittered, except for the bound on
// shading normals (`vpl/reflect.wgsl`).
//
// Departure: rays instead of rasterisation. Few texels are needed, and a point light needs one map instead of six.
#import "many_light/rsm/layout.wgsl"
#import "scene/sequence.wgsl"
#import "scene/lights.wgsl"
#import "scene/trace.wgsl"
#import "many_light/vpl/reflect.wgsl"

@group(1) @binding(11) var<storage, read> rsm_lights: array<RsmLight>;  // in the order of `lights`
@group(1) @binding(12) var<storage, read_write> rsm: array<vec4u>;      // packed as virtual point lights
@group(1) @binding(19) var<uniform> params: Params;

struct Params {
    texels: u32,
    jitter: u32,  // 1: rays go through a random point of their texel, 0: through its centre
    seed: u32,
}

fn store(texel: u32, packed: PackedVpl) {
    let first = vpl_words() * texel;
    rsm[first] = packed.place;
    rsm[first + 1u] = packed.light;
    if (HAS_LOBES) {
        rsm[first + 2u] = packed.arriving;
        rsm[first + 3u] = packed.lobe;
    }
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let texel = id.x;
    if (texel >= params.texels) {
        return;
    }
    // Find the light by binary search.
    var low = 0u;
    var high = arrayLength(&rsm_lights) - 1u;
    while (low < high) {
        let middle = (low + high + 1u) / 2u;
        if (rsm_lights[middle].first <= texel) {
            low = middle;
        } else {
            high = middle - 1u;
        }
    }
    let map = rsm_lights[low];
    let light = lights[low];
    // Trace the texel's ray.
    let random = sobol_2d(sequence.index, hash2(texel, params.seed));
    let inside = select(vec2f(0.5), random, params.jitter != 0u);
    let uv = (vec2f(texel_of_number(texel - map.first, map.level)) + inside) / f32(1u << map.level);
    let texels = f32(1u << (2u * map.level));
    let sent = sample_ray_of(light, 0.0, uv, uv);
    let hit = trace(sent.ray, FLOAT_MAX);
    if (hit.triangle == NONE || max3(sent.flux) <= 0.0) {
        store(texel, PackedVpl(vec4u(0u), vec4u(0u), vec4u(0u), vec4u(0u)));
        return;
    }
    // The area is the inverse density of rays on the surface; textures are averaged over the texel's beam.
    let falloff = select(1.0 / (hit.distance * hit.distance), 1.0, sent.parallel);
    let density = max(texels * sent.ray_density * falloff, 1e-30);
    let s = surface_of_cone(hit, sent.ray.direction, inverseSqrt(density));
    let cosine = max(abs(dot(s.geometric_normal, sent.ray.direction)), 1e-6);
    let area = 1.0 / max(density * cosine, 1e-30);
    let nearness = select(1.0 / hit.distance, 0.0, sent.parallel);
    let flux = sent.flux * hit.tint * (light.probability / texels);
    store(texel, pack_vpl(reflect_flux(s, sent.ray.direction, flux, area, nearness)));
}
