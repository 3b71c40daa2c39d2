// One invocation gathers for four pixels as `sampled.wgsl` does, with the number of rays that earlier frames of the still
// picture gave the tile, and measures how much one ray more or less would matter.
//
// Pixels of a thread have the same VPLs, so the visible shares s of their light differ mostly by the rays' noise: the
// variance of a pixel's radiance with one ray is about K U^2 (s_a - s_b)^2 / 2, with U the radiance of the class without
// shadows. In: G-buffer, VPLs, scene, counts of rays. Out: as `sampled.wgsl`; statistics of each thread, radiance in
// `scene.light_unit`. Errs as `drawn.wgsl` says: counts depend on earlier frames only, so the mean stays unbiased. The
// variance errs high where the pixels differ, as at edges of shadows.
#import "many_light/gather/drawn.wgsl"
#import "many_light/gather/ray_tile.wgsl"

override RAYS: u32 = 1u;  // K in the first frame of a picture

@group(1) @binding(15) var<storage, read_write> statistics: array<vec4f>;
@group(1) @binding(17) var ray_counts: texture_2d<u32>;

// Returns whether the four pixels lie in the grid and show a lit surface: 1 or 0.
fn lit_pixels(place: Place, at: Receivers) -> vec4f {
    let row = vec4u(place.pixel.y) + vec4u(0u, 1u, 2u, 3u) * INTERLEAVE;
    let depth = vec4f(at.a.depth, at.b.depth, at.c.depth, at.d.depth);
    return select(vec4f(0.0), vec4f(1.0), (row < vec4u(grid_size().y)) & (depth > vec4f(0.0)));
}

// Returns the radiance that a pixel reflects, over the scale of the weights of VPLs: 1 with coats, which weights include.
fn reflected_share(at: Receiver) -> f32 {
    return select(luminance(at.brdf.diffuse) * INV_PI, 1.0, HAS_COATS);
}

// Returns the visible share of a pixel's light.
fn visible_share(color: vec3f, coat: vec3f, at: Receiver, total: f32) -> f32 {
    var found = luminance(color);
    if (HAS_COATS) {
        found = luminance(color * max(at.brdf.diffuse, vec3f(0.01)) * INV_PI + coat);
    }
    return select(0.0, found / max(total, 1e-37), total > 0.0);
}

// Returns the statistics of `ray_tile.wgsl` of a thread.
fn statistics_of(found: Drawn, lit: vec4f, at: Receivers, rays: f32) -> vec4f {
    let share = vec4f(
        visible_share(found.colors[0], found.coats[0], at.a, found.total.x),
        visible_share(found.colors[1], found.coats[1], at.b, found.total.y),
        visible_share(found.colors[2], found.coats[2], at.c, found.total.z),
        visible_share(found.colors[3], found.coats[3], at.d, found.total.w));
    let reflected =
        vec4f(reflected_share(at.a), reflected_share(at.b), reflected_share(at.c), reflected_share(at.d));
    let unit = light_factor() / scene.light_unit;
    let whole = min(found.total * reflected * unit, vec4f(1e15)) * lit;
    // Compare neighbours.
    let apart = share.xyz - share.yzw;
    let pairs = lit.xyz * lit.yzw;
    let squared = 0.5 * (whole.xyz * whole.xyz + whole.yzw * whole.yzw);
    let count = dot(lit, vec4f(1.0));
    let noise = 0.5 * dot(pairs * apart * apart, squared) / max(dot(pairs, vec3f(1.0)), 1.0) * count;
    return vec4f(count, dot(share, whole), noise * rays, noise);
}

@compute @workgroup_size(GROUP_X, GROUP_Y)
fn main(
    @builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) thread: vec3u,
    @builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u
) {
    let place = place_of(group, thread);
    let index = id.y * groups.x * GROUP_X + id.x;
    if (any(place.pixel >= grid_size())) {
        statistics[index] = vec4f(0.0);
        return;
    }
    let at = load_receivers(place.pixel);
    let planned = textureLoad(ray_counts, tile_of_thread(group, thread), 0).r;
    let rays = select(clamp(planned, 1u, MOST_RAYS), RAYS, sequence.still == 0u);
    let found = gather_drawn(place, at, rays);
    store_results(place, found.colors * light_factor(), found.coats * light_factor(), at);
    statistics[index] = statistics_of(found, lit_pixels(place, at), at, f32(rays));
}
