// One invocation voxelizes a triangle; a workgroup shares large ones.
//
// A triangle of a solid flips the bit of the slice that it passes at the centre of a cell; `fill.wgsl` fills solids by
// the parity of these bits. A triangle of a shell sets all slices that it passes within a cell. Edges are lines in
// homogeneous coordinates, so nothing is clipped (Olano and Greer 1997, "Triangle Scan Conversion Using 2D Homogeneous
// Coordinates"). In: the scene, its solid triangles, the depth range. Out: cells, boundaries of solids first, then
// shells. Errs by omitting solids thinner than a slice or a cell, and by widening shells by up to a cell.
#import "shared/gbuffer/vertices.wgsl"
#import "ssil/voxels/slices.wgsl"

override HAS_SOLIDS: bool = true;
override HAS_SHELLS: bool = true;
override HAS_CUTS: bool = false;  // alpha-masked materials

struct Params {
    size: vec2u,     // cells
    cell: f32,       // pixels of the picture along the side of a cell
    shells: u32,     // first word of shells
    first: u32,      // entry of the index buffer
    triangles: u32,
    slot: u32,       // of the first instance
    count: u32,      // triangles of all instances
}

@group(1) @binding(11) var<storage, read> range: array<u32>;
@group(1) @binding(12) var<storage, read> solid_triangles: array<u32>;  // a bit each
@group(1) @binding(13) var<storage, read_write> cells: array<atomic<u32>>;
@group(1) @binding(14) var<storage, read> raster_indices: array<u32>;
@group(1) @binding(19) var<uniform> params: Params;

const ROW: u32 = 4096u;   // threads along x: large scenes exceed a dispatch's workgroups along one axis
const GROUP: u32 = 64u;
const LARGE: u32 = 200u;  // a workgroup shares triangles of more cells. tools/README.md, "Constants"
// Margin of a shell beyond its edges, cells along the axis closer to the edge's normal: 0.5 covers every row or column
// that the shell passes; 0.001 is for rounding.
const SHELL_MARGIN: f32 = 0.501;
// Least area, as a share of the terms that it sums. Their rounding is 1e-7, so below 1e-5 slopes err by over 1 %: the
// triangle is edge-on or tiny, and fills its whole depth range in each cell.
const MIN_RELATIVE_AREA: f32 = 1e-5;
// Nearest voxelized depth, as a share of the nearest visible depth: segments between visible surfaces come no nearer
// than the latter; half of it leaves room for rounding.
const MIN_RELATIVE_DEPTH: f32 = 0.5;

var<workgroup> large: array<u32, GROUP>;
var<workgroup> large_count: atomic<u32>;

struct Corner {
    place: vec3f,  // cells times w, and w: view depth, or 1 under parallel rays
    depth: f32,
    triangle: u32,
}

fn corner_of(entry: u32, slot: u32) -> Corner {
    let vertex = raster_vertex(raster_indices[entry], slot);
    let way = vertex.position - view.position;
    let depth = dot(way, view.forward);
    let w = select(depth, 1.0, view.orthographic != 0u);
    let ndc = vec2f(dot(way, view.right) / dot(view.right, view.right), -dot(way, view.up) / dot(view.up, view.up));
    return Corner(vec3f((ndc + w) * vec2f(view.size) * (0.5 / params.cell), w), depth, vertex.triangle);
}

// A line through two corners. Both triangles at an edge compute the same numbers with opposite signs.
struct Edge {
    line: vec3f,
    swapped: bool,
}

fn edge_of(a: vec3f, b: vec3f) -> Edge {
    let swapped = a.x > b.x || (a.x == b.x && (a.y > b.y || (a.y == b.y && a.z > b.z)));
    let line = cross(select(a, b, swapped), select(b, a, swapped));
    return Edge(select(line, -line, swapped), swapped);
}

// Cells that a triangle may pass: from `low` to before `high`.
struct Bounds {
    low: vec2f,
    high: vec2f,
}

// Adds the part of an edge beyond the nearest depth.
fn add_edge(bounds: Bounds, a: vec3f, b: vec3f, nearest: f32) -> Bounds {
    if (max(a.z, b.z) < nearest) {
        return bounds;
    }
    let t = clamp((nearest - a.z) / select(b.z - a.z, 1.0, a.z == b.z), 0.0, 1.0);
    let cut = mix(a, b, t).xy / nearest;
    let p = select(a.xy / a.z, cut, a.z < nearest);
    let q = select(b.xy / b.z, cut, b.z < nearest);
    return Bounds(min(bounds.low, min(p, q)), max(bounds.high, max(p, q)));
}

fn bounds_of(a: vec3f, b: vec3f, c: vec3f, nearest: f32) -> Bounds {
    let none = Bounds(vec2f(FLOAT_MAX), vec2f(-FLOAT_MAX));
    return add_edge(add_edge(add_edge(none, a, b, nearest), b, c, nearest), c, a, nearest);
}

// Sets the slices from `ends.x` to `ends.y`, clamped to the grid.
fn set_slices(cell: u32, ends: vec2f) {
    if (ends.y < 0.0 || ends.x >= f32(SLICES)) {
        return;
    }
    let low = u32(max(ends.x, 0.0));
    let high = u32(min(ends.y, f32(SLICES) - 1.0));
    let first = params.shells + cell * (SLICES / 32u);
    for (var word = low / 32u; word <= high / 32u; word += 1u) {
        let l = max(low, 32u * word) & 31u;
        let h = min(high, 32u * word + 31u) & 31u;
        let mask = (0xffffffffu << l) & (0xffffffffu >> (31u - h));
        // A load is cheaper than an atomic if all bits are already set.
        if ((mask & ~atomicLoad(&cells[first + word])) != 0u) {
            atomicOr(&cells[first + word], mask);
        }
    }
}

// Flips the first slice whose middle lies behind `at`.
fn flip_slice(cell: u32, at: f32) {
    let bit = u32(clamp(round(at), 0.0, f32(SLICES)));
    if (bit < SLICES) {
        atomicXor(&cells[cell * (SLICES / 32u) + bit / 32u], 1u << (bit & 31u));
    }
}

fn is_solid(triangle: u32) -> bool {
    return HAS_SOLIDS && (!HAS_SHELLS || ((solid_triangles[triangle / 32u] >> (triangle & 31u)) & 1u) != 0u);
}

// Returns whether a masked triangle is cut out at a point; `off`: its signed distances from the three edges, scaled.
fn is_hole(triangle: u32, off: vec3f) -> bool {
    let shares = max(off, vec3f(0.0));
    return is_cut_out(load_triangle(triangle), shares.yz / max(shares.x + shares.y + shares.z, 1e-37));
}

// Voxelizes every `lanes`-th cell of a triangle from `lane` on, unless it has more than `most` cells. Returns the
// number of its cells.
fn voxelize(number: u32, lane: u32, lanes: u32, most: u32) -> u32 {
    let slot = params.slot + number / params.triangles;
    let entry = params.first + 3u * (number % params.triangles);
    let a = corner_of(entry, slot);
    let b = corner_of(entry + 1u, slot);
    let c = corner_of(entry + 2u, slot);
    let slices = slices_of(range[0], range[1]);
    let parallel = view.orthographic != 0u;
    let bounds = bounds_of(a.place, b.place, c.place, select(MIN_RELATIVE_DEPTH * slices.near, 1.0, parallel));
    let low = vec2i(clamp(floor(bounds.low), vec2f(0.0), vec2f(params.size)));
    let high = vec2i(clamp(floor(bounds.high) + 1.0, vec2f(0.0), vec2f(params.size)));
    let size = vec2u(max(high - low, vec2i(0)));
    let depths = vec2f(min(min(a.depth, b.depth), c.depth), max(max(a.depth, b.depth), c.depth));
    let ends = vec2f(slice_at(slices, depths.x), slice_at(slices, depths.y));
    let count = select(0u, size.x * size.y, ends.x < f32(SLICES));
    if (count > most) {
        return count;
    }
    let edges = array<Edge, 3>(edge_of(b.place, c.place), edge_of(c.place, a.place), edge_of(a.place, b.place));
    let area = dot(a.place, edges[0].line);
    let side = select(1.0, -1.0, area < 0.0);
    let swapped = vec3<bool>(edges[0].swapped, edges[1].swapped, edges[2].swapped);
    let lines = mat3x3f(side * edges[0].line, side * edges[1].line, side * edges[2].line);
    let slopes = transpose(lines);
    let wider = SHELL_MARGIN * max(abs(slopes[0]), abs(slopes[1]));
    // 1 / depth is linear in the picture; under parallel rays, depth is.
    let plane = lines * select(vec3f(1.0), vec3f(a.depth, b.depth, c.depth), parallel) / max(abs(area), 1e-37);
    let thin = abs(area) <= MIN_RELATIVE_AREA * dot(abs(a.place), abs(edges[0].line));
    let reach = 0.5 * (abs(plane.x) + abs(plane.y));
    let solid = is_solid(a.triangle);
    for (var k = lane; k < count; k += lanes) {
        let at = vec2u(low) + vec2u(k % size.x, k / size.x);
        let cell = at.y * params.size.x + at.x;
        let centre = vec3f(vec2f(at) + 0.5, 1.0);
        let off = centre * lines;
        let middle = dot(plane, centre);
        if (solid) {
            let depth = clamp(select(1.0 / max(middle, 1e-37), middle, parallel), depths.x, depths.y);
            // A centre on an edge belongs to one of its two triangles.
            if (all((off > vec3f(0.0)) | ((off == vec3f(0.0)) & (swapped != vec3<bool>(side < 0.0))))) {
                flip_slice(cell, slice_at(slices, depth));
            }
        } else if (HAS_SHELLS && all(off + wider >= vec3f(0.0))) {
            if (HAS_CUTS && is_hole(a.triangle, off)) {
                continue;
            }
            let around = vec2f(middle - reach, middle + reach);
            let passed = clamp(select(1.0 / max(around.yx, vec2f(1e-37)), around, parallel), depths.xx, depths.yy);
            set_slices(cell, select(vec2f(slice_at(slices, passed.x), slice_at(slices, passed.y)), ends, thin));
        }
    }
    return count;
}

@compute @workgroup_size(GROUP)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(local_invocation_index) thread: u32) {
    // WebGPU zeroes workgroup memory; wgpu-native 29 does not.
    if (thread == 0u) {
        atomicStore(&large_count, 0u);
    }
    workgroupBarrier();
    let number = id.y * ROW + id.x;
    if (number < params.count && voxelize(number, 0u, 1u, LARGE) > LARGE) {
        large[atomicAdd(&large_count, 1u)] = number;
    }
    workgroupBarrier();
    let shared_count = atomicLoad(&large_count);
    for (var k = 0u; k < shared_count; k += 1u) {
        voxelize(large[k], thread, GROUP, 0xffffffffu);
    }
}
