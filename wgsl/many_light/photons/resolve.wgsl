// One invocation adds the light that photons have left at a pixel: E = deposit unit / width^2 of the pixel. In: deposits. In and
// out: irradiance, W/m2; coats' radiance over `coat_tint`, W/(m2 sr). Exact.
#import "shared/gbuffer/load.wgsl"
#import "many_light/photons/deposits.wgsl"

@group(1) @binding(11) var<storage, read> deposits: array<u32>;
@group(1) @binding(12) var<storage, read> glossy_deposits: array<u32>;
@group(1) @binding(14) var<storage, read_write> irradiance: array<vec4f>;
@group(1) @binding(15) var<storage, read_write> glossy: array<vec4f>;
@group(1) @binding(19) var<uniform> params: Params;

struct Params {
    count: u32,
    least_weight: f32,
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (any(id.xy >= view.size)) {
        return;
    }
    if (load_distance(id.xy) <= 0.0) {
        return;
    }
    let index = id.y * view.size.x + id.x;
    let unit = deposit_unit() / squared_width(id.xy);
    let flux = vec3u(deposits[3u * index], deposits[3u * index + 1u], deposits[3u * index + 2u]);
    irradiance[index] += vec4f(vec3f(flux) * unit, 0.0);
    let coat = vec3u(glossy_deposits[3u * index], glossy_deposits[3u * index + 1u], glossy_deposits[3u * index + 2u]);
    glossy[index] += vec4f(vec3f(coat) * unit, 0.0);
}
