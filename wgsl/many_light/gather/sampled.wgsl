// One invocation gathers for four pixels with RAYS shadow rays each: the equation of `drawn.wgsl`.
//
// In: G-buffer, VPLs, scene. Out: irradiance, W/m2, and the coats' radiance, W/(m2 sr). Errs as `drawn.wgsl` says.
#import "many_light/gather/drawn.wgsl"

override RAYS: u32 = 1u;  // K, of each pixel

@compute @workgroup_size(GROUP_X, GROUP_Y)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) thread: vec3u) {
    let place = place_of(group, thread);
    if (any(place.pixel >= grid_size())) {
        return;
    }
    let at = load_receivers(place.pixel);
    let found = gather_drawn(place, at, RAYS);
    store_results(place, found.colors * light_factor(), found.coats * light_factor(), at);
}
