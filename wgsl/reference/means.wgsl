// The running means of the path tracer's pixels, and how new paths join them.
#import "scene/info.wgsl"

// A pixel an element, rows from the top; W/(m2 sr).
@group(1) @binding(12) var<storage, read_write> emission: array<vec4f>;   // a: number of samples
@group(1) @binding(13) var<storage, read_write> direct: array<vec4f>;
@group(1) @binding(14) var<storage, read_write> indirect: array<vec4f>;
// Sum of (x - mean)^2, light_unit^2; a: share of the paths whose camera ray hits a surface.
@group(1) @binding(15) var<storage, read_write> deviation: array<vec4f>;

struct Means {
    emission: vec4f,
    direct: vec3f,
    indirect: vec3f,
    deviation: vec4f,
}

// The new paths' sums of each layer, of (x - old mean) and its square, in `light_unit`, and of camera rays that hit.
struct Sums {
    emission: vec3f,
    direct: vec3f,
    indirect: vec3f,
    offset: vec3f,
    square: vec3f,
    hits: f32,
    count: u32,
}

// Returns the means of a pixel; zeros unless the run `continues`.
fn load_means(index: u32, continues: bool) -> Means {
    return Means(
        select(vec4f(0.0), emission[index], continues),
        select(vec3f(0.0), direct[index].rgb, continues),
        select(vec3f(0.0), indirect[index].rgb, continues),
        select(vec4f(0.0), deviation[index], continues));
}

// Merges the new samples of a pixel with the old ones (Chan et al. 1979).
fn merge_means(index: u32, old: Means, sums: Sums) {
    let old_count = old.emission.a;
    let new_count = f32(sums.count);
    let total = old_count + new_count;
    if (total == 0.0) {
        return;
    }
    let share = new_count / total;
    let per_new = 1.0 / max(new_count, 1.0);
    let mean_offset = sums.offset * per_new;
    let squares = max(sums.square - new_count * mean_offset * mean_offset, vec3f(0.0));
    let between = mean_offset * mean_offset * (old_count * share);
    emission[index] = vec4f(mix(old.emission.rgb, sums.emission * per_new, share), total);
    direct[index] = vec4f(mix(old.direct, sums.direct * per_new, share), 1.0);
    indirect[index] = vec4f(mix(old.indirect, sums.indirect * per_new, share), 1.0);
    deviation[index] = vec4f(
        old.deviation.rgb + squares + between, mix(old.deviation.a, sums.hits * per_new, share));
}
