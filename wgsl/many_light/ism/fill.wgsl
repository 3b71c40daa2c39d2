// One invocation fills one cell of a map, between the rays at its four corners.
//
// Where one plane explains all four hits, the cell is that plane. Where large triangles meet at a silhouette, the cell
// is listed for rays of its own blocks of texels. Else each block takes the nearest of the triangles that its own
// direction meets. A triangle smaller than a cell stands for the quarter of the cell around its ray: the farthest of the
// planes that explain that ray's hit, and nowhere nearer than the hit, because receivers lie on such surfaces. Errs
// either way at silhouettes of what no ray met and by a block, and bright where small things stand before each other
// closely.
//
// In: the points that rays found. Out: the atlas, and the list of cells.
#import "many_light/ism/map.wgsl"
#import "many_light/ism/open_cells.wgsl"

@group(1) @binding(11) var<storage, read> near_points: array<vec4f>;
@group(1) @binding(12) var atlas: texture_storage_2d<r32uint, write>;

@group(1) @binding(13) var<storage, read> drawn: array<u32>;  // the points drawn before, one for each texel
@group(1) @binding(14) var<storage, read_write> open_cells: array<u32>;
@group(1) @binding(15) var<storage, read_write> open_groups: array<atomic<u32>>;  // workgroups x, y, z; cells

override DRAWN: bool = true;
override REFINED: bool = true;  // list cells for rays of their own

// By how much one plane may miss another corner's hit, over its distance: below the half footprint of a texel that the
// lookup allows. Chosen.
const FLAT: f32 = 0.005;

// By how much a plane may miss another corner's hit and still be the same curved surface, over its distance, in cells
// that it spans. Chosen so that what is wrongly lit and wrongly dark balances in Sponza.
const CURVED: f32 = 0.45;

// Cells whose blocks get rays of their own: those of triangles that are no narrower than this, in texels (of smaller
// ones, rays would find more and more), with hits whose distances are in a greater ratio. Chosen.
const OPEN_WIDTH: f32 = 1.0;
const OPEN_STEP: f32 = 1.4;

// The points at the corners, one in each column: so w * planes are four dot products.
struct Points {
    planes: mat4x3f,  // dot(m, w) = 1 / t on the triangle's plane
    row0: mat4x3f,    // barycentric weights over t, of two of its corners
    row1: mat4x3f,
    small: vec4<bool>,  // it is smaller than a cell
}

// What a quarter of a cell takes where its directions meet no triangle.
struct Quarter {
    standing: vec4<bool>,  // the planes that explain the hit of its ray
    always: bool,          // they stand before triangles, too
    cap: f32,              // 1 / t of the nearest that they may be
}

// Returns the plane that a direction meets, zero for nothing.
fn plane_met(w: vec3f, p: Points, quarter: Quarter) -> vec3f {
    let inverse = w * p.planes;
    let b0 = w * p.row0;
    let b1 = w * p.row1;
    let inside = (min(min(b0, b1), inverse - b0 - b1) >= vec4f(0.0)) & (inverse > vec4f(0.0));
    let depth = select(vec4f(0.0), inverse, inside);
    let first = max(max(depth.x, depth.y), max(depth.z, depth.w));
    // A convex surface lies behind all the planes that touch it.
    let far = select(vec4f(1e30), inverse, quarter.standing);
    let last = min(min(far.x, far.y), min(far.z, far.w));
    let stands = any(quarter.standing) && (first <= 0.0 || (quarter.always && last > first));
    let chosen = select(first, last, stands);
    let met = select(depth, far, stands);
    let plane = select(
        select(p.planes[3], p.planes[2], met.z == chosen), select(p.planes[1], p.planes[0], met.x == chosen),
        met.x == chosen || met.y == chosen);
    let capped = select(plane, w * quarter.cap, stands && chosen > quarter.cap);
    return select(vec3f(0.0), capped, chosen > 0.0);
}

// Returns what stands in the quarter around the ray of a corner.
fn quarter_of(p: Points, w: vec3f, distances: vec4f, corner: u32) -> Quarter {
    let own = vec4<bool>(corner == 0u, corner == 1u, corner == 2u, corner == 3u);
    let distance = distances[corner];
    let group = abs(w * p.planes * distance - 1.0) < vec4f(CURVED * 2.5 * f32(CELL) / f32(ISM_RESOLUTION));
    let hit = distances > vec4f(0.0);
    let small = p.small & hit;
    let is_small = any(small & own);
    // Between large triangles that it misses and small ones, it is one of the latter.
    let rest = select(own & hit, small, vec4<bool>(any(small)));
    let standing = select(rest & vec4<bool>(distance > 0.0), group & hit, vec4<bool>(is_small));
    return Quarter(standing, is_small, select(1e30, 1.0 / max(distance, 1e-30), is_small));
}

fn store(at: vec2u, texel: u32) {
    var nearest = texel;
    if (DRAWN) {
        nearest = max(texel, drawn[at.y * textureDimensions(atlas).x + at.x]);
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
    let cells = ISM_RESOLUTION / CELL;
    let cell = id.xy;
    let slot = id.z;
    if (any(cell >= vec2u(cells))) {
        return;
    }
    let corner = cell * CELL;
    if (is_below_horizon(vec2f(corner) + 0.5 * f32(CELL), 0.75 * f32(CELL))) {
        return;
    }
    let to = map_corner(slot, textureDimensions(atlas).x) + corner;
    let side = cells + 1u;
    let first = 3u * (slot * side * side + cell.y * side + cell.x);
    let row = 3u * side;
    let a = near_points[first];
    let b = near_points[first + 3u];
    let c = near_points[first + row];
    let d = near_points[first + row + 3u];
    let off = abs(vec3f(
        dot(a.xyz, ray_direction(vec2f(corner + vec2u(CELL, 0u)))) * b.w,
        dot(a.xyz, ray_direction(vec2f(corner + vec2u(0u, CELL)))) * c.w,
        dot(a.xyz, ray_direction(vec2f(corner + vec2u(CELL, CELL)))) * d.w) - 1.0);
    let nothing = max(max(a.w, b.w), max(c.w, d.w)) <= 0.0;
    let flat = nothing || (a.w > 0.0 && max3(off) < FLAT);
    let distances = vec4f(a.w, b.w, c.w, d.w);
    var points: Points;
    var open = false;
    if (!flat) {
        let a0 = near_points[first + 1u];
        let b0 = near_points[first + 4u];
        let c0 = near_points[first + row + 1u];
        let d0 = near_points[first + row + 4u];
        let a1 = near_points[first + 2u];
        let b1 = near_points[first + 5u];
        let c1 = near_points[first + row + 2u];
        let d1 = near_points[first + row + 5u];
        let nearest = min(min(a.w, b.w), min(c.w, d.w));
        let farthest = max(max(a.w, b.w), max(c.w, d.w));
        let wide = vec4f(a1.w, b1.w, c1.w, d1.w) > vec4f(OPEN_WIDTH / f32(CELL));
        open = REFINED && farthest > OPEN_STEP * nearest && all(wide | (distances <= vec4f(0.0)));
        points = Points(
            mat4x3f(a.xyz, b.xyz, c.xyz, d.xyz), mat4x3f(a0.xyz, b0.xyz, c0.xyz, d0.xyz),
            mat4x3f(a1.xyz, b1.xyz, c1.xyz, d1.xyz), vec4f(a0.w, b0.w, c0.w, d0.w) < vec4f(0.5));
    }
    if (open) {
        let place = atomicAdd(&open_groups[3], 1u);
        if (place < arrayLength(&open_cells)) {
            open_cells[place] = pack_open_cell(slot, cell);
            atomicMax(&open_groups[0], ((place + 1u) * open_rows() + OPEN_GROUP - 1u) / OPEN_GROUP);
            atomicMax(&open_groups[1], 1u);
            atomicMax(&open_groups[2], 1u);
            return;
        }
    }
    for (var q = 0u; q < 4u; q += 1u) {
        let step = vec2u(q & 1u, q >> 1u);
        var quarter: Quarter;
        if (!flat) {
            quarter = quarter_of(points, ray_direction(vec2f(corner + step * CELL)), distances, q);
        }
        let start = step * (CELL / 2u);
        for (var y = 0u; y < CELL / 2u; y += BLOCK) {
            for (var x = 0u; x < CELL / 2u; x += BLOCK) {
                let at = start + vec2u(x, y);
                let w = map_direction(vec2f(corner + at) + 0.5 * f32(BLOCK));
                var m = a.xyz;
                if (!flat) {
                    m = plane_met(w, points, quarter);
                }
                store_block(to + at, block_texels(w, m));
            }
        }
    }
}
