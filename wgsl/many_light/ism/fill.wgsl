// One invocation fills one cell of a map from the rays at its four corners.
//
// 1. All four hits in one plane: the cell shows that plane. 2. Large triangles at different distances: a silhouette
// cell, listed for rays of its own. 3. Else each block shows the nearest hit triangle that its direction meets. Around
// a triangle smaller than a cell it shows the farthest of the planes that explain the hit, at least as far as the hit,
// because receivers lie on such surfaces. In: `ray_hits`, `samples` (splats). Out: atlas, list of silhouette cells.
// Errs either way within a block at silhouettes and where no ray hit, bright where small objects stand close behind
// each other.
#import "many_light/ism/map.wgsl"
#import "many_light/ism/silhouette_cells.wgsl"

@group(1) @binding(11) var<storage, read> ray_hits: array<vec4f>;  // as `ism/rays.wgsl` writes them
@group(1) @binding(12) var atlas: texture_storage_2d<r32uint, write>;
@group(1) @binding(13) var<storage, read> samples: array<u32>;     // nearest splat of each texel
@group(1) @binding(14) var<storage, read_write> silhouette_cells: array<u32>;
@group(1) @binding(15) var<storage, read_write> refine_groups: array<atomic<u32>>;  // workgroups x, y, z; cells
@group(1) @binding(19) var<uniform> params: Params;

struct Params {
    first_slot: u32,  // of the maps to fill
}

override SPLATTED: bool = true;  // there are splats
override REFINED: bool = true;   // list silhouette cells

// A cell is planar up to this relative error of a plane at another corner's hit: about the bias by which
// `ism/lookup.wgsl` moves receivers at a resolution of 128, 0.0055. tools/README.md, "Constants".
const PLANAR_ERROR: f32 = 0.005;

// Two hits lie on one curved surface up to this relative error per radian between their corners. It balances false
// light and false shadow there. tools/README.md, "Constants".
const CURVED_ERROR: f32 = 0.45;

// In a silhouette cell the farthest hit is at least this many times as far as the nearest, and no hit triangle is
// narrower than this many texels: rays between narrower triangles would find ever more of them. tools/README.md,
// "Constants".
const MIN_DISTANCE_RATIO: f32 = 1.4;
const MIN_REFINED_WIDTH: f32 = 1.0;

// The hits at the four corners of a cell: x, y, z, w are upper left, upper right, lower left, lower right.
struct Corners {
    planes: mat4x3f,    // m of each in a column, so w * planes are four dot products 1 / t
    row0: mat4x3f,      // barycentric weights over t, of two corners of the triangle
    row1: mat4x3f,
    distances: vec4f,   // metres, 0: nothing hit
    small: vec4<bool>,  // narrower than a cell
}

// The planes that a quarter of a cell shows where directions meet no hit triangle.
struct Fallback {
    planes: vec4<bool>,  // which of the four explain the hit of the quarter's ray
    always: bool,        // the hit triangle is small: the planes may also hide triangles
    nearest: f32,        // bound of 1 / t
}

// Returns the plane that a direction meets, 0 for nothing.
fn plane_met(w: vec3f, corners: Corners, fallback: Fallback) -> vec3f {
    // Find the nearest triangle that contains the direction.
    let inverse = w * corners.planes;
    let b0 = w * corners.row0;
    let b1 = w * corners.row1;
    let inside = (min(min(b0, b1), inverse - b0 - b1) >= vec4f(0.0)) & (inverse > vec4f(0.0));
    let depth = select(vec4f(0.0), inverse, inside);
    let first = max(max(depth.x, depth.y), max(depth.z, depth.w));
    // Find the farthest of the fallback's planes: a convex surface lies behind all of its tangent planes.
    let far = select(vec4f(1e30), inverse, fallback.planes);
    let last = min(min(far.x, far.y), min(far.z, far.w));
    let falls_back = any(fallback.planes) && (first <= 0.0 || (fallback.always && last > first));
    // Take the plane with the chosen value.
    let chosen = select(first, last, falls_back);
    let met = select(depth, far, falls_back);
    let plane = select(
        select(corners.planes[3], corners.planes[2], met.z == chosen),
        select(corners.planes[1], corners.planes[0], met.x == chosen), met.x == chosen || met.y == chosen);
    let capped = select(plane, w * fallback.nearest, falls_back && chosen > fallback.nearest);
    return select(vec3f(0.0), capped, chosen > 0.0);
}

// Returns the fallback of the quarter at a corner, whose ray has the direction w.
fn fallback_of(corners: Corners, w: vec3f, corner: u32) -> Fallback {
    let own = vec4<bool>(corner == 0u, corner == 1u, corner == 2u, corner == 3u);
    let distance = corners.distances[corner];
    let angle = TEXEL_ANGLE * f32(RAY_SPACING) / f32(ISM_RESOLUTION);
    let same_surface = abs(w * corners.planes * distance - 1.0) < vec4f(CURVED_ERROR * angle);
    let hit = corners.distances > vec4f(0.0);
    let small = corners.small & hit;
    let is_small = any(small & own);
    // A direction that misses the large triangles shows the small ones, if there are any.
    let others = select(own & hit, small, vec4<bool>(any(small)));
    let planes = select(others & vec4<bool>(distance > 0.0), same_surface & hit, vec4<bool>(is_small));
    return Fallback(planes, is_small, select(1e30, 1.0 / max(distance, 1e-30), is_small));
}

fn load_corners(first: u32, row: u32) -> Corners {
    let a = ray_hits[first];
    let b = ray_hits[first + 3u];
    let c = ray_hits[first + row];
    let d = ray_hits[first + row + 3u];
    let a0 = ray_hits[first + 1u];
    let b0 = ray_hits[first + 4u];
    let c0 = ray_hits[first + row + 1u];
    let d0 = ray_hits[first + row + 4u];
    let a1 = ray_hits[first + 2u];
    let b1 = ray_hits[first + 5u];
    let c1 = ray_hits[first + row + 2u];
    let d1 = ray_hits[first + row + 5u];
    return Corners(
        mat4x3f(a.xyz, b.xyz, c.xyz, d.xyz), mat4x3f(a0.xyz, b0.xyz, c0.xyz, d0.xyz),
        mat4x3f(a1.xyz, b1.xyz, c1.xyz, d1.xyz), vec4f(a.w, b.w, c.w, d.w),
        vec4f(a0.w, b0.w, c0.w, d0.w) < vec4f(0.5));
}

// Returns the widths of the hit triangles in cells.
fn load_widths(first: u32, row: u32) -> vec4f {
    return vec4f(
        ray_hits[first + 2u].w, ray_hits[first + 5u].w, ray_hits[first + row + 2u].w, ray_hits[first + row + 5u].w);
}

// Adds a cell to the list, and raises the workgroup count of the passes over it.
fn list_cell(slot: u32, cell: vec2u) {
    let place = atomicAdd(&refine_groups[3], 1u);
    silhouette_cells[place] = pack_silhouette_cell(slot, cell);
    atomicMax(&refine_groups[0], ((place + 1u) * blocks_per_side() + REFINE_GROUP - 1u) / REFINE_GROUP);
    atomicMax(&refine_groups[1], 1u);
    atomicMax(&refine_groups[2], 1u);
}

fn store(at: vec2u, texel: u32) {
    var nearest = texel;
    if (SPLATTED) {
        nearest = max(texel, samples[at.y * textureDimensions(atlas).x + at.x]);
    }
    textureStore(atlas, at, vec4u(nearest));
}

fn store_block(at: vec2u, texels: vec4u) {
    store(at, texels.x);
    store(at + vec2u(1u, 0u), texels.y);
    store(at + vec2u(0u, 1u), texels.z);
    store(at + vec2u(1u, 1u), texels.w);
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let cells = ISM_RESOLUTION / RAY_SPACING;
    let cell = id.xy;
    let slot = params.first_slot + id.z;
    if (any(cell >= vec2u(cells))) {
        return;
    }
    let corner = cell * RAY_SPACING;
    if (is_below_horizon(vec2f(corner) + 0.5 * f32(RAY_SPACING), 0.75 * f32(RAY_SPACING))) {
        return;
    }
    let to = map_corner(slot, textureDimensions(atlas).x) + corner;
    let side = cells + 1u;
    let first = 3u * (slot * side * side + cell.y * side + cell.x);
    let row = 3u * side;

    // Test whether the plane of the first corner explains the other hits.
    let plane = ray_hits[first].xyz;
    let distances = vec4f(
        ray_hits[first].w, ray_hits[first + 3u].w, ray_hits[first + row].w, ray_hits[first + row + 3u].w);
    let off = abs(vec3f(
        dot(plane, ray_direction(vec2f(corner + vec2u(RAY_SPACING, 0u)))) * distances.y,
        dot(plane, ray_direction(vec2f(corner + vec2u(0u, RAY_SPACING)))) * distances.z,
        dot(plane, ray_direction(vec2f(corner + vec2u(RAY_SPACING, RAY_SPACING)))) * distances.w) - 1.0);
    let farthest = max(max(distances.x, distances.y), max(distances.z, distances.w));
    let planar = farthest <= 0.0 || (distances.x > 0.0 && max3(off) < PLANAR_ERROR);

    // List silhouette cells.
    var corners: Corners;
    if (!planar) {
        corners = load_corners(first, row);
        let nearest = min(min(distances.x, distances.y), min(distances.z, distances.w));
        let wide = load_widths(first, row) > vec4f(MIN_REFINED_WIDTH / f32(RAY_SPACING));
        if (REFINED && farthest > MIN_DISTANCE_RATIO * nearest && all(wide | (distances <= vec4f(0.0)))) {
            list_cell(slot, cell);
            return;
        }
    }

    // Fill the blocks, quarter by quarter.
    for (var q = 0u; q < 4u; q += 1u) {
        let step = vec2u(q & 1u, q >> 1u);
        var fallback: Fallback;
        if (!planar) {
            fallback = fallback_of(corners, ray_direction(vec2f(corner + step * RAY_SPACING)), q);
        }
        let start = step * (RAY_SPACING / 2u);
        for (var y = 0u; y < RAY_SPACING / 2u; y += BLOCK) {
            for (var x = 0u; x < RAY_SPACING / 2u; x += BLOCK) {
                let at = start + vec2u(x, y);
                let w = map_direction(vec2f(corner + at) + 0.5 * f32(BLOCK));
                var m = plane;
                if (!planar) {
                    m = plane_met(w, corners, fallback);
                }
                store_block(to + at, block_texels(w, m));
            }
        }
    }
}
