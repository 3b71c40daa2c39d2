// Draws points on the scene's surfaces in proportion to their area, by inverse transform sampling of cumulative areas:
// first the instance, then the triangle of its mesh, then the place in it, by a low-discrepancy sequence.
//
// Exact: where a transform or a pose stretches a mesh unevenly, triangles are drawn by their area before it, and each
// point's represented area corrects for that.
#import "scene/surface.wgsl"
#import "scene/see_through.wgsl"
#import "common/random.wgsl"
#import "deferred/environment/reflectance.wgsl"

struct AreaInstance {
    cumulative: f32,   // area of this instance and those before it, over that of all
    share: f32,        // area of this instance over that of all
    first: u32,        // first triangle of its mesh
    count: u32,        // of triangles
    instance: u32,     // of the scene, which transforms the triangles; NONE: they are in world space
    local_area: f32,   // of the mesh before the transform, m2; 0: of a deformed mesh, `area_cdf` alone tells the shares
}

@group(1) @binding(11) var<storage, read> area_instances: array<AreaInstance>;
@group(1) @binding(12) var<storage, read> area_cdf: array<f32>;  // by triangle, cumulative over its mesh
@group(1) @binding(13) var<storage, read_write> points: array<vec4u>;

// Mean cosine of the angle of incidence of light from all directions, weighted by that cosine.
const MEAN_COSINE: f32 = 2.0 / 3.0;

// Stores point `index` of the sequence that `seed` scrambles, for `count` points that share the area.
fn store_point(slot: u32, index: u32, count: u32, seed: u32) {
    // Find the instance.
    let u = sobol_2d(index, seed);
    let choice = u.x;
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
    // Find the triangle of its mesh.
    let placed = area_instances[low];
    let inside = (choice - (placed.cumulative - placed.share)) / max(placed.share, 1e-30);
    low = placed.first;
    // A scene without triangles has one instance of 0 triangles.
    high = placed.first + max(placed.count, 1u) - 1u;
    var before = 0.0;
    var upto = 1.0;
    while (low < high) {
        let middle = (low + high) / 2u;
        let sum = area_cdf[middle];
        if (sum > inside) {
            high = middle;
            upto = sum;
        } else {
            low = middle + 1u;
            before = sum;
        }
    }
    // Draw a point of the triangle. What the choice leaves is its first coordinate, so points are stratified within
    // large triangles, too.
    let left = saturate((inside - before) / max(upto - before, 1e-30));
    let weights = sample_triangle(vec2f(left, u.y));
    let t = load_triangle(low);
    let stored_area = 0.5 * length(cross(t.edge1, t.edge2));
    let s = surface_on(t, Hit(0.0, low, placed.instance, weights - anchor_weights(t), UNTINTED), vec3f(0.0, 0.0, 1.0));
    // Compute the area that the point represents: area / (probability of the triangle * number of points).
    var edge1 = t.edge1;
    var edge2 = t.edge2;
    if (HAS_INSTANCES && t.instance == NONE) {
        let world_from_local = instances[placed.instance].world_from_local;
        edge1 = world_from_local * vec4f(edge1, 0.0);
        edge2 = world_from_local * vec4f(edge2, 0.0);
    }
    let area = 0.5 * length(cross(edge1, edge2));
    var share = area * placed.local_area / max(stored_area * placed.share * f32(count), 1e-37);
    if (placed.local_area == 0.0) {
        share = area / max((upto - before) * placed.share * f32(count), 1e-37);
    }
    // Of the points on see-through surfaces, as many are open as light passes.
    var open = false;
    if (is_see_through(t.material)) {
        let passes = luminance(passage_of_weights(t, weights, 1.0, false).tint);
        open = unit_float(hash2(index, seed ^ 0x51ed270bu)) < passes;
    }
    // Store the point with its reflectance.
    let b = surface_brdf(s);
    let albedo = select(directional_reflectance(b, MEAN_COSINE), vec3f(0.0), (s.flags & UNLIT) != 0u);
    points[2u * slot] = vec4u(bitcast<vec3u>(s.position), pack2x16snorm(octahedral_encode(s.geometric_normal)));
    points[2u * slot + 1u] = vec4u(
        bitcast<u32>(sqrt(share * INV_PI)), pack4x8unorm(vec4f(albedo, select(1.0, 0.0, open))), low, placed.instance);
}
