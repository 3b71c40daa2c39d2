// One invocation computes the light that 2x2 pixels of the first level send, its workgroup that of coarser levels.
//
// Phi = sum_j L_j ds_j (eq. 3), W/sr on a surface that faces the receiver, over the pixels j of the picture in a
// pixel's square: no energy is lost or gained where surfaces do not survive the vote. With HAS_REFLECTORS also sum_j
// rho_j / pi ds_j, m2/sr, which turns an irradiance into the light of the next bounce. In: G-buffer, direct light,
// W/(m2 sr). Out: codes of `common/light_code.wgsl`; the first level's brightest light.
#import "ssil/pixel_surfel.wgsl"
#import "ssil/light_levels.wgsl"
#import "ssil/peak.wgsl"
#import "common/matte.wgsl"

override SQUARE: u32 = 2u;  // picture pixels per side of a pixel of the first level
override HAS_REFLECTORS: bool = false;
override SPLIT: bool = false;  // rays bring the light of shiny surfaces: they send none here

@group(1) @binding(11) var<storage, read> direct: array<vec4f>;
@group(1) @binding(14) var<storage, read_write> reflectors: array<vec2u>;
@group(1) @binding(16) var<storage, read_write> shines: array<atomic<u32>>;  // 1 if the picture shows shiny surfaces

struct Sent {
    light: vec3f,       // W/sr
    reflectors: vec3f,  // m2/sr
}

// Returns the light that a pixel of the first level sends, and its reflectors.
fn sent_by(pixel: vec2u, facing: vec4f) -> Sent {
    var sum = Sent(vec3f(0.0), vec3f(0.0));
    for (var k = 0u; k < SQUARE * SQUARE; k += 1u) {
        let fine = SQUARE * pixel + vec2u(k % SQUARE, k / SQUARE);
        if (any(fine >= view.size)) {
            continue;
        }
        let hit_distance = load_distance(fine);
        let radiance = direct[fine.y * view.size.x + fine.x].rgb;
        // The area of a surface without light matters only for reflectors.
        if (hit_distance <= 0.0 || (!HAS_REFLECTORS && !SPLIT && max3(radiance) <= 0.0)) {
            continue;
        }
        let surface = load_surface(fine);
        let area = pixel_surfel(fine, surface, hit_distance, facing).area;
        let is_shiny = SPLIT && !is_matte_brdf(gbuffer_brdf(surface));
        if (is_shiny) {
            atomicStore(&shines[0], 1u);
        }
        sum.light += select(radiance, vec3f(0.0), is_shiny) * area;
        if (HAS_REFLECTORS) {
            let is_lit = (surface.flags & GBUFFER_UNLIT) == 0u;
            sum.reflectors += select(vec3f(0.0), gbuffer_brdf(surface).diffuse * INV_PI, is_lit) * area;
        }
    }
    return sum;
}

@compute @workgroup_size(TILE_THREADS, TILE_THREADS)
fn main(
    @builtin(global_invocation_id) id: vec3u, @builtin(local_invocation_id) local: vec3u,
    @builtin(workgroup_id) group: vec3u,
) {
    let size = (view.size + SQUARE - 1u) / SQUARE;
    let facing = facing_side();
    var sum = vec3f(0.0);
    var brightest = 0.0;
    for (var k = 0u; k < 4u; k += 1u) {
        let pixel = thread_pixel(id.xy, k);
        if (any(pixel >= size)) {
            continue;
        }
        let sent = sent_by(pixel, facing);
        sum += store_light(pixel, size, sent.light);
        brightest = max(brightest, max3(sent.light));
        if (HAS_REFLECTORS) {
            reflectors[pixel.y * size.x + pixel.x] = pack_light(sent.reflectors);
        }
    }
    store_coarser(group.xy, local.xy, size, sum);
    raise_peak(brightest);
}
