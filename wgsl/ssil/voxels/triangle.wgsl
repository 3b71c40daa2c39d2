// A triangle in the voxel grid: the cells that it may pass, and what it sets in each of them.
//
// A triangle of a solid flips the bit of the slice that it passes at the centre of a cell; `fill.wgsl` fills solids by
// the parity of these bits. A triangle of a shell sets all slices that it passes within a cell. Edges are lines in
// homogeneous coordinates, so nothing is clipped (Olano and Greer 1997, "Triangle Scan Conversion Using 2D Homogeneous
// Coordinates"). Bits are flipped and set by atomics, so the result does not depend on the order of triangles. Errs by
// omitting solids thinner than a slice or a cell, and by widening shells by up to a cell.
#import "shared/gbuffer/vertices.wgsl"
#import "scene/see_through.wgsl"
#import "ssil/voxels/slices.wgsl"

override HAS_SOLIDS: bool = true;
override HAS_SHELLS: bool = true;
override HAS_CUTS: bool = false;  // alpha-masked materials

@group(1) @binding(11) var<storage, read> range: array<u32>;
@group(1) @binding(12) var<storage, read> solid_triangles: array<u32>;  // a bit each
// Boundaries of solids, then shells, then the list of tiles: its number of entries, and TILE_WORDS words each.
@group(1) @binding(13) var<storage, read_write> cells: array<atomic<u32>>;
@group(1) @binding(14) var<storage, read> raster_indices: array<u32>;

struct Grid {
    size: vec2u,   // cells
    cell: f32,     // pixels of the picture along the side of a cell
    shells: u32,   // first word of shells
    list: u32,     // first word of the list of tiles
}

const TILE: u32 = 16u;         // cells along a side
const TILE_WORDS: u32 = 4u;    // entry of the index buffer, instance slot, place in tiles (x + 65536 y), 1 if masked
// Margin of a shell beyond its edges, cells along the axis closer to the edge's normal: 0.5 covers every row or column
// that the shell passes; 0.001 is for rounding.
const SHELL_MARGIN: f32 = 0.501;
// Least area, as a share of the terms that it sums. Their rounding is 1e-7, so below 1e-5 slopes err by over 1 %: the
// triangle is edge-on or tiny, and fills its whole depth range in each cell.
const MIN_RELATIVE_AREA: f32 = 1e-5;
// Nearest voxelized depth, as a share of the nearest visible depth: segments between visible surfaces come no nearer
// than the latter; half of it leaves room for rounding.
const MIN_RELATIVE_DEPTH: f32 = 0.5;

struct Corner {
    place: vec3f,  // cells times w, and w: view depth, or 1 under parallel rays
    depth: f32,
    triangle: u32,
}

fn corner_of(entry: u32, slot: u32, grid: Grid) -> Corner {
    let vertex = raster_vertex(raster_indices[entry], slot);
    let way = vertex.position - view.position;
    let depth = dot(way, view.forward);
    let w = select(depth, 1.0, view.orthographic != 0u);
    let ndc = vec2f(dot(way, view.right) / dot(view.right, view.right), -dot(way, view.up) / dot(view.up, view.up));
    return Corner(vec3f((ndc + w) * vec2f(view.size) * (0.5 / grid.cell), w), depth, vertex.triangle);
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

// The part of the picture that a triangle covers, in cells.
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
fn set_slices(cell: u32, ends: vec2f, shells: u32) {
    if (ends.y < 0.0 || ends.x >= f32(SLICES)) {
        return;
    }
    let low = u32(max(ends.x, 0.0));
    let high = u32(min(ends.y, f32(SLICES) - 1.0));
    let first = shells + cell * (SLICES / 32u);
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

// Returns whether a masked triangle is cut out at a point; `off`: its signed distances from the three edges, scaled. A
// see-through one is open in as many cells as it lets light pass.
fn is_hole(triangle: u32, off: vec3f, cell: u32) -> bool {
    let shares = max(off, vec3f(0.0));
    let weights = shares.yz / max(shares.x + shares.y + shares.z, 1e-37);
    let t = load_triangle(triangle);
    if (is_see_through(t.material)) {
        return unit_float(hash2(cell, triangle)) < luminance(passage_of_weights(t, weights, 1.0, false).tint);
    }
    return is_cut_out(t, weights);
}

// The cells that a triangle may pass, from `low` to before `high`, and what finds them.
struct Footprint {
    corners: array<Corner, 3>,
    slices: Slices,
    depths: vec2f,  // least and greatest
    ends: vec2f,    // their slices
    low: vec2u,
    high: vec2u,
}

fn footprint_of(entry: u32, slot: u32, grid: Grid) -> Footprint {
    var f: Footprint;
    let a = corner_of(entry, slot, grid);
    let b = corner_of(entry + 1u, slot, grid);
    let c = corner_of(entry + 2u, slot, grid);
    f.corners = array<Corner, 3>(a, b, c);
    f.slices = slices_of(range[0], range[1]);
    let parallel = view.orthographic != 0u;
    let bounds = bounds_of(a.place, b.place, c.place, select(MIN_RELATIVE_DEPTH * f.slices.near, 1.0, parallel));
    f.low = vec2u(clamp(floor(bounds.low), vec2f(0.0), vec2f(grid.size)));
    f.high = vec2u(clamp(floor(bounds.high) + 1.0, vec2f(0.0), vec2f(grid.size)));
    f.depths = vec2f(min(min(a.depth, b.depth), c.depth), max(max(a.depth, b.depth), c.depth));
    f.ends = vec2f(slice_at(f.slices, f.depths.x), slice_at(f.slices, f.depths.y));
    // Nothing lies behind the last slice.
    f.high = select(f.low, f.high, f.ends.x < f32(SLICES));
    return f;
}

// Returns the number of cells.
fn cell_count(f: Footprint) -> u32 {
    let size = max(vec2i(f.high) - vec2i(f.low), vec2i(0));
    return u32(size.x * size.y);
}

// The lines along a triangle's edges, positive inside, and its depth as a function of the place.
struct Lines {
    lines: mat3x3f,
    owned: vec3<bool>,  // a centre on the edge belongs to this triangle, not to its neighbour
    wider: vec3f,       // margin of a shell, in units of the lines
    plane: vec3f,       // 1 / depth is linear in the picture; under parallel rays, depth is
    reach: f32,         // change of that within half a cell
    thin: bool,         // edge-on or tiny
    solid: bool,
}

fn lines_of(f: Footprint) -> Lines {
    let a = f.corners[0];
    let b = f.corners[1];
    let c = f.corners[2];
    let parallel = view.orthographic != 0u;
    let edges = array<Edge, 3>(edge_of(b.place, c.place), edge_of(c.place, a.place), edge_of(a.place, b.place));
    let area = dot(a.place, edges[0].line);
    let side = select(1.0, -1.0, area < 0.0);
    var t: Lines;
    t.owned = vec3<bool>(edges[0].swapped, edges[1].swapped, edges[2].swapped) != vec3<bool>(side < 0.0);
    t.lines = mat3x3f(side * edges[0].line, side * edges[1].line, side * edges[2].line);
    let slopes = transpose(t.lines);
    t.wider = SHELL_MARGIN * max(abs(slopes[0]), abs(slopes[1]));
    t.plane = t.lines * select(vec3f(1.0), vec3f(a.depth, b.depth, c.depth), parallel) / max(abs(area), 1e-37);
    t.reach = 0.5 * (abs(t.plane.x) + abs(t.plane.y));
    t.thin = abs(area) <= MIN_RELATIVE_AREA * dot(abs(a.place), abs(edges[0].line));
    t.solid = is_solid(a.triangle);
    return t;
}

// Sets or flips the slices of the cell at `at`. `cut`: the triangle's material is alpha-masked.
fn voxelize_cell(f: Footprint, t: Lines, at: vec2u, cut: bool, grid: Grid) {
    let parallel = view.orthographic != 0u;
    let cell = at.y * grid.size.x + at.x;
    let centre = vec3f(vec2f(at) + 0.5, 1.0);
    let off = centre * t.lines;
    let middle = dot(t.plane, centre);
    if (t.solid) {
        let depth = clamp(select(1.0 / max(middle, 1e-37), middle, parallel), f.depths.x, f.depths.y);
        if (all((off > vec3f(0.0)) | ((off == vec3f(0.0)) & t.owned))) {
            flip_slice(cell, slice_at(f.slices, depth));
        }
    } else if (HAS_SHELLS && all(off + t.wider >= vec3f(0.0))) {
        if (HAS_CUTS && cut && is_hole(f.corners[0].triangle, off, cell)) {
            return;
        }
        let around = vec2f(middle - t.reach, middle + t.reach);
        let passed = clamp(
            select(1.0 / max(around.yx, vec2f(1e-37)), around, parallel), f.depths.xx, f.depths.yy);
        let between = vec2f(slice_at(f.slices, passed.x), slice_at(f.slices, passed.y));
        set_slices(cell, select(between, f.ends, t.thin), grid.shells);
    }
}
