// One invocation computes the resampling weight of a candidate: an estimate of its contribution to the view. One
// workgroup sums a block of them.
//
// w = luminance(flux) * (mean_k cos cos / (d^2 + r^2) * R^2 + floor) over the view samples k, without visibility; R is
// the scene's radius, r = R / 10 bounds near candidates. As photons, candidates count by their lobe's flux. In: candidates, W, and view samples, metres. Out: cumulative
// weights within each block, and the blocks' sums. Weights cause no bias: resampling divides by them.
#import "many_light/vpl/candidates.wgsl"
#import "many_light/vpl/lobe.wgsl"
#import "many_light/vpl/view_sample.wgsl"
#import "scene/info.wgsl"

override VIEW: bool = true;   // true: weight by the contribution to the view; false: by flux alone
override LOBES: bool = false; // weigh candidates as photons of their lobes, not as VPLs
override GRID: bool = false;  // equal weights, but 0 for black candidates: the texels of the maps are a regular grid

@group(1) @binding(11) var<storage, read_write> cumulative: array<f32>;
@group(1) @binding(12) var<storage, read_write> block_sums: array<f32>;
@group(1) @binding(15) var<storage, read> view_samples: array<ViewSample>;
@group(1) @binding(19) var<uniform> params: Params;

struct Params {
    texels: u32,      // of reflective shadow maps
    candidates: u32,  // texels and vertices of light paths
}

// Weight of a candidate that no view sample faces, over the weight of one that a sample faces at the distance R. It
// limits the excess brightness of such VPLs where an unsampled part of the view needs them. tools/README.md,
// "Constants".
const WEIGHT_FLOOR: f32 = 0.02;
// As photons, candidates of little weight make bright dots: photons are not blurred as much as VPLs are.
const PHOTON_FLOOR: f32 = 0.2;

var<workgroup> sums: array<f32, BLOCK>;

// Returns the light of a candidate in a direction over that of a diffuse one, half of it as if it were diffuse: the view
// samples may miss the lobe. The lobe of a photon is at least as wide as the gaps between 64 samples.
fn share_towards(v: Vpl, way: vec3f) -> f32 {
    if (LOBES) {
        let lobe = widened_flux_towards(v, way, 4.0 * v.area) - v.flux;
        return 0.5 + 0.5 * luminance(lobe) / max(luminance(v.lobe.flux), 1e-37);
    }
    return 0.5 + 0.5 * luminance(flux_towards(v, way)) / max(luminance(total_flux(v)), 1e-37);
}

// Returns the flux by which a candidate is drawn, W.
fn drawn_flux(v: Vpl) -> f32 {
    if (LOBES) {
        return max(luminance(v.lobe.flux), 0.0) * mean_photon_share(v);
    }
    return max(luminance(total_flux(v)), 0.0);
}

// Returns the mean geometry term between a candidate and the view samples, times R^2.
fn view_importance(v: Vpl) -> f32 {
    let squared_radius = scene.radius * scene.radius;
    var importance = 0.0;
    // A quarter of the view samples is enough for photons.
    let step = select(1u, 4u, LOBES);
    for (var k = 0u; k < arrayLength(&view_samples); k += step) {
        let p = view_samples[k];
        let between = p.position - v.position;
        let squared = dot(between, between);
        var cosines = max(dot(between, v.normal), 0.0) * max(-dot(between, p.normal), 0.0);
        if (HAS_LOBES && cosines > 0.0) {
            cosines *= share_towards(v, between);
        }
        importance += p.weight * cosines / max(squared * (squared + 0.01 * squared_radius), 1e-37);
    }
    return importance * squared_radius * f32(step) / f32(arrayLength(&view_samples));
}

@compute @workgroup_size(256)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(local_invocation_index) thread: u32,
    @builtin(workgroup_id) group: vec3u) {
    // Weight the candidate.
    var weight = 0.0;
    if (id.x < params.candidates) {
        let v = load_candidate(id.x, params.texels);
        weight = drawn_flux(v);
        if (GRID) {
            weight = select(0.0, 1.0, weight > 0.0);
        }
        if (VIEW && weight > 0.0) {
            weight *= view_importance(v) + select(WEIGHT_FLOOR, PHOTON_FLOOR, LOBES);
        }
    }
    sums[thread] = weight;
    // Make the weights of the block cumulative by the parallel prefix sum of Hillis and Steele 1986.
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
        block_sums[group.x] = sums[thread];
    }
}
