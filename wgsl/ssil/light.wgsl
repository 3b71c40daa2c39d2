// One invocation adds up what the pixels of a square send out: their light times their area, or with REFLECTORS what
// turns their irradiance into that.
//
// Phi = sum_j L_j ds_j (eq. 3), W/sr on a surface that faces the receiver, or sum_j rho_j / pi ds_j, m2/sr. So no
// energy is lost or found where surfaces do not survive the vote. In: G-buffer, direct light. Out: codes of
// `common/light_code.wgsl`, and the largest of them as bits of a float.
#import "ssil/pixel.wgsl"
#import "common/light_code.wgsl"

override SQUARE: u32 = 2u;  // its side, pixels
override REFLECTORS: bool = false;

@group(1) @binding(11) var<storage, read> direct: array<vec4f>;
@group(1) @binding(12) var<storage, read_write> light: array<vec2u>;
@group(1) @binding(13) var<storage, read_write> peak: array<atomic<u32>>;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let size = (view.size + SQUARE - 1u) / SQUARE;
    if (any(id.xy >= size)) {
        return;
    }
    let facing = facing_side();
    var sum = vec3f(0.0);
    for (var y = 0u; y < SQUARE; y += 1u) {
        for (var x = 0u; x < SQUARE; x += 1u) {
            let pixel = SQUARE * id.xy + vec2u(x, y);
            if (any(pixel >= view.size)) {
                continue;
            }
            let seen = load_distance(pixel);
            var sent = vec3f(0.0);
            if (!REFLECTORS) {
                sent = direct[pixel.y * view.size.x + pixel.x].rgb;
            }
            // Light that is black leaves no surface, so the surface need not be found.
            if (seen <= 0.0 || (!REFLECTORS && max3(sent) <= 0.0)) {
                continue;
            }
            let surface = load_surface(pixel);
            if (REFLECTORS) {
                let lit = (surface.flags & GBUFFER_UNLIT) == 0u;
                sent = select(vec3f(0.0), gbuffer_brdf(surface).diffuse * INV_PI, lit);
            }
            sum += sent * pixel_surfel(pixel, surface, seen, facing).area;
        }
    }
    light[id.y * size.x + id.x] = pack_light(sum);
    let bits = bitcast<u32>(max3(sum));
    // Reading first is cheaper where it is not the largest, which is the rule.
    if (bits > atomicLoad(&peak[0])) {
        atomicMax(&peak[0], bits);
    }
}
