// What all ways to gather share: the lists, the bound of near VPLs, and what they leave for each pixel.
#import "many_light/vpl/table.wgsl"
#import "many_light/gather/pixels.wgsl"
#import "many_light/gather/clusters.wgsl"
#import "many_light/gather/receiver.wgsl"
#import "common/coat.wgsl"

// Share of a VPL's area that bounds it. A whole disc, exact only straight above it, takes too much light from corners.
// Cornell box, 1024 VPLs drawn by the view, rays, 16 frames, relMSE and bias with 1, 0.5, 0.25: point light 0.0038,
// 0.0028, 0.0023 and -2.5, -1.8, -1.3 %; area light 0.0061, 0.0052, 0.0046 and -1.7, -0.9, -0.3 %.
const BOUND_SHARE: f32 = 0.25;

override BOUNDED: bool = true; // the geometry term, by the VPL's area
override CULLED: bool = true;  // clusters have lists
override ADDED: bool = false;  // to what other passes have found
override COMPENSATED: bool = false;  // what the bound takes is found later, by `compensate.wgsl`

@group(1) @binding(11) var<storage, read_write> irradiance: array<vec4f>;  // W/m2; depth of `shared/denoise/plane.wgsl`
@group(1) @binding(12) var<storage, read_write> normals: array<u32>;       // of `shared/denoise/plane.wgsl`
@group(1) @binding(13) var<storage, read> lists: array<u32>;               // bits of VPLs, by cluster
@group(1) @binding(14) var<storage, read_write> glossy: array<vec4f>;      // W/(m2 sr), over coat_tint()
@group(1) @binding(15) var<storage, read_write> bound_sums: array<vec2f>;  // of `Bounds`
@group(1) @binding(16) var near_shares: texture_2d<f32>;                   // of VPLs, as `many_light/near/shares.wgsl` has them

@group(1) @binding(19) var<uniform> params: Params;

struct Params {
    vpl_count: u32,   // slots of the table
    first_word: u32,  // of each class, of `exact.wgsl`
    seed: u32,        // of `sampled.wgsl`
    near_reach: f32,  // of the near field, heights of the picture
}

// The mean bound of the VPLs that light a pixel is `bounds` / `weights`, m2: weighed by how much of their light it takes.
struct Bounds {
    bounds: vec4f,   // of four pixels
    weights: vec4f,
}

// Adds a VPL that gives light of luminance `light`, bound and all.
fn add_bound(b: Bounds, bound: f32, squared: vec4f, light: vec4f) -> Bounds {
    let weights = light * bound / max(squared + bound, vec4f(1e-37));
    return Bounds(b.bounds + bound * weights, b.weights + weights);
}

// Returns where the list of a pixel's cluster begins.
fn list_of(pixel: vec2u, class_number: u32) -> u32 {
    let inside = min(pixel, view.size - 1u);
    let tile = tile_of(inside, view.size);
    var cluster = tile;
    if (SLICES > 1u) {
        let slices = Slicing(lists[2u * tile], lists[2u * tile + 1u]);
        cluster = tile * SLICES + slice_of(slices, load_distance(inside));
    }
    return first_list(view.size) + (cluster * class_count() + class_number) * words_per_class(params.vpl_count);
}

// Returns where the lists of a thread's four pixels begin.
fn lists_of(place: Place) -> vec4u {
    if (!CULLED) {
        return vec4u(0u);
    }
    let step = vec2u(0u, INTERLEAVE);
    return vec4u(
        list_of(place.pixel, place.class_number), list_of(place.pixel + step, place.class_number),
        list_of(place.pixel + 2u * step, place.class_number), list_of(place.pixel + 3u * step, place.class_number));
}

fn load_four(pixel: vec2u) -> Four {
    let step = vec2u(0u, INTERLEAVE);
    return Four(
        load_receiver(pixel, params.near_reach), load_receiver(pixel + step, params.near_reach),
        load_receiver(pixel + 2u * step, params.near_reach), load_receiver(pixel + 3u * step, params.near_reach));
}

// Returns what the bound of the geometry term adds to the squared distance, m2.
fn bound_of(vpl: Vpl) -> f32 {
    return select(0.0, BOUND_SHARE * INV_PI * vpl.area, BOUNDED);
}

// Returns how much of a VPL's light the near field finds, if the VPL is near.
fn load_near_share(slot: u32) -> f32 {
    if (!NEAR) {
        return 0.0;
    }
    return textureLoad(near_shares, vpl_texel(slot), 0).r;
}

fn store(pixel: vec2u, color: vec3f, coat: vec3f, bounds: vec2f, receiver: Receiver) {
    if (pixel.y >= view.size.y) {
        return;
    }
    let index = pixel.y * view.size.x + pixel.x;
    var sum = color;
    if (ADDED) {
        sum += irradiance[index].rgb;
    }
    irradiance[index] = vec4f(sum, receiver.depth);
    normals[index] = pack_view_normal(receiver.normal);
    if (COMPENSATED) {
        var sums = bounds;
        if (ADDED) {
            sums += bound_sums[index];
        }
        bound_sums[index] = sums;
    }
    if (HAS_COATS) {
        var radiance = coat / coat_tint(receiver.brdf, receiver.normal, receiver.to_eye);
        if (ADDED) {
            radiance += glossy[index].rgb;
        }
        glossy[index] = vec4f(radiance, 1.0);
    }
}
