// One fragment enters a surface into the grid (Eisemann and Decoret 2008, "Single-Pass GPU Solid Voxelization").
//
// Surfaces of closed meshes flip the bit of the slice that they begin at; `fill.wgsl` makes solids of that by parity.
// Of others, the slices that they pass within the cell are set. Departure: bits of a buffer flip by atomics, since
// WebGPU has no logical blending. In: the scene, its closed triangles, the range. Out: crossings, shells. Errs by leaving
// out solids thinner than a slice, and what lies between the cells' centres.
#import "gbuffer/vertices.wgsl"
#import "voxels/range.wgsl"

override HAS_SOLIDS: bool = true;
override HAS_SHELLS: bool = true;

struct Params {
    scale: vec2f,  // of the picture's size over that of all cells
    width: u32,    // cells in a row
}

@group(1) @binding(11) var<storage, read> range: array<u32>;
@group(1) @binding(12) var<storage, read> solid_triangles: array<u32>;  // a bit each
@group(1) @binding(13) var<storage, read_write> crossings: array<atomic<u32>>;
@group(1) @binding(14) var<storage, read_write> shells: array<atomic<u32>>;
@group(1) @binding(19) var<uniform> params: Params;

// A surface sets at most this many slices on each side of where it is: those seen edge-on would set all. Chosen.
const MOST_EXTENT: f32 = 8.0;

struct Varyings {
    @builtin(position) clip: vec4f,
    @location(0) @interpolate(flat) ids: vec2u,  // triangle, material
    @location(1) depth: f32,
    @location(2) texcoords: vec4f,
    @location(3) alpha: f32,
}

// Cells at the right and lower border may reach over the picture's.
fn place(position: vec3f) -> vec4f {
    let clip = view.clip_from_world * vec4f(position, 1.0);
    let shift = (params.scale - 1.0) * vec2f(1.0, -1.0) * clip.w;
    return vec4f(clip.xy * params.scale + shift, clip.zw);
}

@vertex
fn vertex(@builtin(vertex_index) index: u32, @builtin(instance_index) slot: u32) -> Varyings {
    let v = raster_vertex(index, slot);
    let depth = dot(v.position - view.position, view.forward);
    return Varyings(place(v.position), vec2u(v.triangle, 0u), depth, vec4f(0.0), 0.0);
}

@vertex
fn vertex_masked(@builtin(vertex_index) index: u32, @builtin(instance_index) slot: u32) -> Varyings {
    let v = raster_vertex(index, slot);
    let mask = mask_of_vertex(index, v.triangle);
    let depth = dot(v.position - view.position, view.forward);
    return Varyings(place(v.position), vec2u(v.triangle, mask.material), depth, mask.texcoords, mask.alpha);
}

fn enter(clip: vec4f, triangle: u32, depth: f32, extent: f32, at: f32) {
    let first = (u32(clip.y) * params.width + u32(clip.x)) * (BITS / 32u);
    let solid = HAS_SOLIDS && (!HAS_SHELLS || ((solid_triangles[triangle / 32u] >> (triangle & 31u)) & 1u) != 0u);
    if (solid) {
        // The first slice whose middle lies behind.
        let bit = u32(clamp(round(at), 0.0, f32(BITS)));
        if (bit < BITS) {
            atomicXor(&crossings[first + bit / 32u], 1u << (bit & 31u));
        }
    } else if (HAS_SHELLS && at + 3.0 * extent >= 0.0 && at + extent < f32(BITS)) {
        let low = u32(clamp(at + extent, 0.0, f32(BITS) - 1.0));
        let high = u32(clamp(at + 3.0 * extent, 0.0, f32(BITS) - 1.0));
        for (var word = low / 32u; word <= high / 32u; word += 1u) {
            let l = max(low, 32u * word) & 31u;
            let h = min(high, 32u * word + 31u) & 31u;
            let mask = (0xffffffffu << l) & (0xffffffffu >> (31u - h));
            // Reading first is cheaper where they are set.
            if ((mask & ~atomicLoad(&shells[first + word])) != 0u) {
                atomicOr(&shells[first + word], mask);
            }
        }
    }
}

@fragment
fn fragment(in: Varyings) -> @location(0) f32 {
    let at = slice_at(slices_of(range[0], range[1]), in.depth);
    enter(in.clip, in.ids.x, in.depth, min(0.5 * fwidth(at), MOST_EXTENT), at);
    return 0.0;
}

@fragment
fn fragment_masked(in: Varyings) -> @location(0) f32 {
    let at = slice_at(slices_of(range[0], range[1]), in.depth);
    let extent = min(0.5 * fwidth(at), MOST_EXTENT);
    if (!is_open(Mask(in.texcoords, in.alpha, in.ids.y))) {
        enter(in.clip, in.ids.x, in.depth, extent, at);
    }
    return 0.0;
}
