// One invocation adds the light that photons have left at a pixel of the grid: E = deposit unit / width^2 of the pixel.
// In: deposits. In and out: irradiance, W/m2; coats' radiance over `coat_tint`, W/(m2 sr). Exact.
#import "shared/gbuffer/load.wgsl"
#import "many_light/photons/deposits.wgsl"
#import "shared/upsample/grid_pixel.wgsl"

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
    if (any(id.xy >= grid_size())) {
        return;
    }
    let pixel = grid_pixel(id.xy);
    if (load_distance(pixel) <= 0.0) {
        return;
    }
    let index = pixel.y * view.size.x + pixel.x;
    let place = id.y * grid_size().x + id.x;
    let unit = deposit_unit() / squared_width(pixel);
    let flux = vec3u(deposits[3u * index], deposits[3u * index + 1u], deposits[3u * index + 2u]);
    irradiance[place] += vec4f(vec3f(flux) * unit, 0.0);
    let coat = vec3u(glossy_deposits[3u * index], glossy_deposits[3u * index + 1u], glossy_deposits[3u * index + 2u]);
    glossy[place] += vec4f(vec3f(coat) * unit, 0.0);
}
