// One invocation weighs a candidate by what it may contribute: its flux, times a mean over points of the view without
// visibility. One workgroup adds up its block.
//
// weight = luminance(flux) * (mean_k cos cos / (d^2 + r^2) + floor), r a tenth of the scene's radius. Out: cumulative
// weights within each block, and the blocks' sums. Weights only say where to look: they bias nothing.
#import "many_light/vpl/vpl.wgsl"
#import "scene/info.wgsl"

override VIEW: bool = true;   // weigh by the view, else by flux alone
override GRID: bool = false;  // or all alike, but for black ones: texels of the maps in their order are a regular grid

struct ViewPoint {
    position: vec3f,
    is_seen: f32,
    normal: vec3f,
    pad: f32,
}

@group(1) @binding(11) var<storage, read_write> cumulative: array<f32>;
@group(1) @binding(12) var<storage, read_write> blocks: array<f32>;
@group(1) @binding(13) var<storage, read> rsm: array<vec4u>;
@group(1) @binding(14) var<storage, read> walk: array<vec4u>;
@group(1) @binding(15) var<storage, read> view_points: array<ViewPoint>;
@group(1) @binding(19) var<uniform> params: Params;

struct Params {
    texels: u32,      // of reflective shadow maps
    candidates: u32,  // these and all vertices of paths
}

const BLOCK: u32 = 256u;
// Of a light that faces a surface as far off as the scene's radius: what no point of the view may need still gets some.
// Chosen.
const FLOOR: f32 = 0.02;

var<workgroup> sums: array<f32, BLOCK>;

@compute @workgroup_size(256)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(local_invocation_index) thread: u32,
    @builtin(workgroup_id) group: vec3u) {
    var weight = 0.0;
    if (id.x < params.candidates) {
        var v: Vpl;
        if (id.x < params.texels) {
            v = unpack_vpl(rsm[2u * id.x], rsm[2u * id.x + 1u]);
        } else {
            let slot = id.x - params.texels;
            v = unpack_vpl(walk[2u * slot], walk[2u * slot + 1u]);
        }
        weight = max(luminance(v.flux), 0.0);
        if (GRID) {
            weight = select(0.0, 1.0, weight > 0.0);
        }
        if (VIEW && weight > 0.0) {
            let squared_radius = scene.radius * scene.radius;
            var importance = 0.0;
            for (var k = 0u; k < arrayLength(&view_points); k += 1u) {
                let p = view_points[k];
                let between = p.position - v.position;
                let squared = dot(between, between);
                let cosines = max(dot(between, v.normal), 0.0) * max(-dot(between, p.normal), 0.0);
                importance += p.is_seen * cosines / max(squared * (squared + 0.01 * squared_radius), 1e-37);
            }
            weight *= importance * squared_radius / f32(arrayLength(&view_points)) + FLOOR;
        }
    }
    sums[thread] = weight;
    // Hillis and Steele 1986.
    for (var step = 1u; step < BLOCK; step *= 2u) {
        workgroupBarrier();
        let below = select(0.0, sums[max(thread, step) - step], thread >= step);
        workgroupBarrier();
        sums[thread] += below;
    }
    workgroupBarrier();
    if (id.x < params.candidates) {
        cumulative[id.x] = sums[thread];
    }
    if (thread == BLOCK - 1u) {
        blocks[group.x] = sums[thread];
    }
}
