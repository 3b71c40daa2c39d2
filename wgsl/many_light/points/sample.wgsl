// One invocation puts a point on the scene's surfaces, in proportion to their area.
//
// In: cumulative areas of instances, and of the triangles of each mesh. Out: points as `many_light/points/table.wgsl` has them.
// Under a transform that stretches a mesh unevenly, points go by the area before it, and each stands for as much area
// after it as makes up for that.
#import "scene/surface.wgsl"
#import "common/random.wgsl"
#import "deferred/environment/reflectance.wgsl"

struct AreaInstance {
    cumulative: f32,   // share of this instance and those before it of all area
    share: f32,
    first: u32,        // its mesh's triangles
    count: u32,
    instance: u32,     // scene instance that places the triangles; NONE: they lie in the world
    local_area: f32,   // of the mesh as it is stored, m2
}

@group(1) @binding(11) var<storage, read> area_instances: array<AreaInstance>;
@group(1) @binding(12) var<storage, read> area_cdf: array<f32>;  // by triangle, within its mesh
@group(1) @binding(13) var<storage, read_write> points: array<vec4u>;

// The index of a point is the same in all sequences; the seeds are arbitrary.
const PLACE_SEED: u32 = 0x5bd1e995u;
const WEIGHTS_SEED: u32 = 0x1b873593u;

// Light of all directions arrives at this cosine in the mean.
const MEAN_COSINE: f32 = 2.0 / 3.0;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let index = id.y * groups.x * 64u + id.x;
    let count = arrayLength(&points) / 2u;
    if (index >= count) {
        return;
    }
    // Find the instance, then the triangle.
    let choice = sobol_2d(index, PLACE_SEED).x;
    var low = 0u;
    var high = arrayLength(&area_instances) - 1u;
    while (low < high) {
        let middle = (low + high) / 2u;
        if (area_instances[middle].cumulative > choice) {
            high = middle;
        } else {
            low = middle + 1u;
        }
    }
    let placed = area_instances[low];
    let inside = (choice - (placed.cumulative - placed.share)) / max(placed.share, 1e-30);
    low = placed.first;
    // A scene without a triangle has one instance of none.
    high = placed.first + max(placed.count, 1u) - 1u;
    while (low < high) {
        let middle = (low + high) / 2u;
        if (area_cdf[middle] > inside) {
            high = middle;
        } else {
            low = middle + 1u;
        }
    }
    let weights = sample_triangle(sobol_2d(index, WEIGHTS_SEED));
    let t = load_triangle(low);
    let stored_area = 0.5 * length(cross(t.edge1, t.edge2));
    let s = surface_at(Hit(0.0, low, placed.instance, weights), vec3f(0.0, 0.0, 1.0));
    var edge1 = t.edge1;
    var edge2 = t.edge2;
    if (HAS_INSTANCES && t.instance == NONE) {
        let world_from_local = instances[placed.instance].world_from_local;
        edge1 = world_from_local * vec4f(edge1, 0.0);
        edge2 = world_from_local * vec4f(edge2, 0.0);
    }
    let area = 0.5 * length(cross(edge1, edge2));
    // area / (probability of the triangle * number of points)
    let share = area * placed.local_area / max(stored_area * placed.share * f32(count), 1e-37);
    let b = surface_brdf(s);
    let albedo = select(directional_reflectance(b, MEAN_COSINE), vec3f(0.0), (s.flags & UNLIT) != 0u);
    points[2u * index] = vec4u(bitcast<vec3u>(s.position), pack2x16snorm(octahedral_encode(s.geometric_normal)));
    points[2u * index + 1u] = vec4u(
        bitcast<u32>(sqrt(share * INV_PI)), pack4x8unorm(vec4f(albedo, 1.0)), low, placed.instance);
}
