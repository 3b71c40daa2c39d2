// Code shared by all gathering passes: light lists, the bound of near VPLs, the receivers of a thread, the results.
#import "many_light/vpl/table.wgsl"
#import "many_light/vpl/lobe.wgsl"
#import "many_light/gather/pixels.wgsl"
#import "many_light/gather/bound.wgsl"
#import "many_light/gather/clusters.wgsl"
#import "many_light/gather/receiver.wgsl"
#import "shared/upsample/grid_pixel.wgsl"
#import "common/coat.wgsl"

override CULLED: bool = true;        // clusters have light lists
override ADDED: bool = false;        // add to the results of earlier passes

@group(1) @binding(11) var<storage, read_write> irradiance: array<vec4f>;  // W/m2; depth of `shared/denoise/plane.wgsl`
@group(1) @binding(12) var<storage, read_write> normals: array<u32>;       // of `shared/denoise/plane.wgsl`
@group(1) @binding(13) var<storage, read> lists: array<u32>;               // masks of VPLs, by cluster, class and word
@group(1) @binding(14) var<storage, read_write> glossy: array<vec4f>;      // W/(m2 sr), over coat_tint()
@group(1) @binding(16) var near_shares: texture_2d<f32>;                   // of `many_light/near_field/shares.wgsl`
@group(1) @binding(19) var<uniform> params: Params;

struct Params {
    vpl_count: u32,
    first_word: u32,  // of each class; only `exact.wgsl` reads it
    seed: u32,        // only `sampled.wgsl` reads it
    near_radius: f32, // r_max of the near field, heights of the picture
}

// Returns the start of the list of the cluster of a pixel of the grid.
fn list_of(place: vec2u, class_number: u32) -> u32 {
    let inside = grid_pixel(place);
    let tile = tile_of(inside, view.size);
    var cluster = tile;
    if (SLICES > 1u) {
        let slices = Slicing(lists[2u * tile], lists[2u * tile + 1u]);
        cluster = tile * SLICES + slice_of(slices, load_distance(inside));
    }
    return first_list(view.size) + (cluster * class_count() + class_number) * words_per_class(params.vpl_count);
}

// Returns the starts of the lists of a thread's four pixels.
fn lists_of(place: Place) -> vec4u {
    if (!CULLED) {
        return vec4u(0u);
    }
    let step = vec2u(0u, INTERLEAVE);
    return vec4u(
        list_of(place.pixel, place.class_number), list_of(place.pixel + step, place.class_number),
        list_of(place.pixel + 2u * step, place.class_number), list_of(place.pixel + 3u * step, place.class_number));
}

// Returns the response of a receiver's coat to a VPL; `reach`: the bounded squared distance, m2.
fn shine_at(r: Receiver, vpl: Vpl, reach: f32) -> Shine {
    return shine_of(r.brdf, r.eye_loss, r.normal, r.to_eye, vpl.position - r.position, reach, vpl.area);
}

fn load_receivers(place: vec2u) -> Receivers {
    let step = vec2u(0u, INTERLEAVE);
    return Receivers(
        load_receiver(grid_pixel(place), params.near_radius),
        load_receiver(grid_pixel(place + step), params.near_radius),
        load_receiver(grid_pixel(place + 2u * step), params.near_radius),
        load_receiver(grid_pixel(place + 3u * step), params.near_radius));
}

// Returns the share of a VPL's light that the near field finds at distance 0.
fn load_near_share(slot: u32) -> f32 {
    if (!NEAR_FIELD) {
        return 0.0;
    }
    return textureLoad(near_shares, vpl_texel(slot), 0).r;
}

// Returns the shares of a VPL's light that gathering adds; the near field adds the rest.
fn far_field_shares(slot: u32, squared: vec4f, at: Receivers) -> vec4f {
    if (!NEAR_FIELD) {
        return vec4f(1.0);
    }
    let near = load_near_share(slot);
    return vec4f(
        far_field_share(near, squared.x, at.a.near_radius), far_field_share(near, squared.y, at.b.near_radius),
        far_field_share(near, squared.z, at.c.near_radius), far_field_share(near, squared.w, at.d.near_radius));
}

// Stores the results of a thread's four pixels, a column each.
fn store_results(place: Place, colors: mat4x3f, coats: mat4x3f, at: Receivers) {
    let step = vec2u(0u, INTERLEAVE);
    store(place.pixel, colors[0], coats[0], at.a);
    store(place.pixel + step, colors[1], coats[1], at.b);
    store(place.pixel + 2u * step, colors[2], coats[2], at.c);
    store(place.pixel + 3u * step, colors[3], coats[3], at.d);
}

// Stores the results of a pixel of the grid: irradiance and the coat's radiance.
fn store(place: vec2u, color: vec3f, coat: vec3f, receiver: Receiver) {
    if (place.y >= grid_size().y) {
        return;
    }
    let index = place.y * grid_size().x + place.x;
    var sum = color;
    if (ADDED) {
        sum += irradiance[index].rgb;
    }
    irradiance[index] = vec4f(sum, receiver.depth);
    normals[index] = pack_view_normal(receiver.normal);
    if (HAS_COATS) {
        var radiance = coat / coat_tint(receiver.brdf, receiver.normal, receiver.to_eye);
        if (ADDED) {
            radiance += glossy[index].rgb;
        }
        glossy[index] = vec4f(radiance, 1.0);
    }
}
