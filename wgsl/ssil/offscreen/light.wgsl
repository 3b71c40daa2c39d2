// One invocation looks up the irradiance that a pixel's rays bring from surfaces that no pixel shows:
// E = 1 / n sum rho E_cell.
//
// In: hits, cells, surfels of the first level. Out: irradiance, W/m2, with the depth of `shared/denoise/plane.wgsl` in w;
// normals for the blur. Errs blurry, by the side of a cell.
#import "shared/radiance_cache/cells.wgsl"
#import "shared/radiance_cache/hits.wgsl"
#import "shared/denoise/plane.wgsl"
#import "ssil/surfel.wgsl"

@group(1) @binding(11) var surfels: texture_2d<u32>;
@group(1) @binding(12) var<storage, read_write> irradiance: array<vec4f>;
@group(1) @binding(13) var<storage, read_write> normals: array<u32>;
@group(1) @binding(19) var<uniform> params: Params;
@group(1) @binding(24) var<storage, read> hits: array<CacheHit>;
@group(1) @binding(25) var<storage, read> cells: array<Cell>;

struct Params {
    rays: u32,  // per pixel
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(surfels);
    if (any(id.xy >= size)) {
        return;
    }
    let number = id.y * size.x + id.x;
    let texel = textureLoad(surfels, id.xy, 0);
    if (is_empty(texel)) {
        irradiance[number] = vec4f(0.0);
        return;
    }
    let rays = select(params.rays, 0u, is_empty(texel));
    var sum = vec3f(0.0);
    for (var k = 0u; k < rays; k += 1u) {
        let cell = hits[number * rays + k].cell;
        if (cell != NO_CELL) {
            sum += unpack_reflectance(hits[number * rays + k].reflectance) * cells[cell].irradiance;
        }
    }
    let depth = dot(surfel_position(texel), view.forward);
    irradiance[number] = vec4f(sum / f32(params.rays), select(1.0 / max(depth, 1e-37), depth, view.orthographic != 0u));
    normals[number] = pack_view_normal(surfel_normal(texel));
}
