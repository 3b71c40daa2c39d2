// One invocation traces an undecided direction, as `ssdo/rays.wgsl` does, and stores an off-screen hit for the
// radiance cache.
//
// In: G-buffer, scene, the list of undecided directions. Out: their entries in `hits`, black for these hits; the hits by
// the index of their direction. Exact.
#import "ssdo/trace_undecided.wgsl"
#import "shared/radiance_cache/hits.wgsl"
#import "shared/radiance_cache/reflectance.wgsl"

@group(1) @binding(24) var<storage, read_write> cache_hits: array<CacheHit>;

fn store_light(entry: HitEntry) {
    store_radiance(entry.index, entry.direction, vec3f(0.0));
    let reflectance = entry.weight * reflectance_of(entry.surface);
    if ((entry.surface.flags & UNLIT) == 0u && max3(reflectance) > 0.0) {
        cache_hits[entry.index] = cache_hit(entry.hit, entry.direction, 0u, reflectance);
    }
}

@compute @workgroup_size(LIST_GROUP)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let count = undecided_count();
    for (var place = id.x; place < count; place += groups.x * LIST_GROUP) {
        let index = undecided_index(place);
        cache_hits[index] = no_cache_hit();
        trace_direction(index);
    }
}
