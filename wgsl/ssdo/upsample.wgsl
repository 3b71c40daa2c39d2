// One invocation brings light of a grid of every other pixel to four pixels, by the weights of `guide.wgsl`.
//
// In: light of the grid, weights, G-buffer. Out: the same light for each pixel, or with REFLECTED the radiance
// rho E / pi, W/(m2 sr).
#import "shared/gbuffer/load.wgsl"

override REFLECTED: bool = false;

@group(1) @binding(11) var<storage, read> coarse: array<vec4f>;
@group(1) @binding(12) var<storage, read> guide: array<u32>;
@group(1) @binding(13) var<storage, read_write> fine: array<vec4f>;

fn load_coarse(grid: vec2u) -> vec3f {
    let size = (view.size + 1u) / 2u;
    let at = min(grid, size - 1u);
    return coarse[at.y * size.x + at.x].rgb;
}

fn bring(light: mat4x3f, pixel: vec2u) {
    if (any(pixel >= view.size)) {
        return;
    }
    let index = pixel.y * view.size.x + pixel.x;
    let weights = unpack4x8unorm(guide[index]);
    let sum = dot(weights, vec4f(1.0));
    let factor = select(vec3f(1.0), gbuffer_brdf(load_surface(pixel)).diffuse * INV_PI, REFLECTED);
    fine[index] = vec4f(light * weights * factor / max(sum, 0.5), select(0.0, 1.0, sum > 0.0));
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let pixel = id.xy * 2u;
    if (any(pixel >= view.size)) {
        return;
    }
    let light = mat4x3f(
        load_coarse(id.xy), load_coarse(id.xy + vec2u(1u, 0u)), load_coarse(id.xy + vec2u(0u, 1u)),
        load_coarse(id.xy + 1u));
    bring(light, pixel);
    bring(light, pixel + vec2u(1u, 0u));
    bring(light, pixel + vec2u(0u, 1u));
    bring(light, pixel + 1u);
}
