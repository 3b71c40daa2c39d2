// One workgroup computes the axis-aligned bounding box of each cluster of a tile.
//
// In: G-buffer. Out: two corners of each cluster, metres, low above high if it is empty; the tile's slicing, in the
// fourth components. Exact.
#import "many_light/gather/clusters.wgsl"
#import "scene/info.wgsl"
#import "common/math.wgsl"

@group(1) @binding(11) var<storage, read_write> bounds: array<vec4f>;
@group(1) @binding(31) var distance: texture_2d<f32>;

const ROWS: u32 = 2u;               // of threads
const PIXELS: u32 = TILE_Y / ROWS;  // of a thread, in a column

var<workgroup> least: atomic<u32>;
var<workgroup> largest: atomic<u32>;
var<workgroup> corners: array<atomic<u32>, 6u * MAX_SLICES>;  // least and largest x, y, z of each slice

// Returns an integer code with the order of the floats, for atomic minima and maxima.
fn ordered_code(x: f32) -> u32 {
    let bits = bitcast<u32>(x);
    return bits ^ select(0x80000000u, 0xffffffffu, (bits & 0x80000000u) != 0u);
}

fn decode_ordered(code: u32) -> f32 {
    return bitcast<f32>(code ^ select(0xffffffffu, 0x80000000u, (code & 0x80000000u) != 0u));
}

fn load_bits(pixel: vec2u) -> u32 {
    return bitcast<u32>(textureLoad(distance, min(pixel, view.size - 1u), 0).r);
}

// Extends the box of a slice.
fn include(slice: u32, low: vec3f, high: vec3f) {
    if (low.x > high.x) {
        return;
    }
    for (var k = 0u; k < 3u; k += 1u) {
        atomicMin(&corners[6u * slice + k], ordered_code(low[k]));
        atomicMax(&corners[6u * slice + 3u + k], ordered_code(high[k]));
    }
}

// Slices the tile between its least and its largest distance; 0 means no surface. All threads of the workgroup call it.
fn slice_tile(first: vec2u) -> Slicing {
    var nearest = 0xffffffffu;
    var farthest = 0u;
    for (var k = 0u; k < PIXELS; k += 1u) {
        let bits = load_bits(first + vec2u(0u, k));
        nearest = min(nearest, select(0xffffffffu, bits, bits > 0u));
        farthest = max(farthest, bits);
    }
    atomicMin(&least, nearest);
    atomicMax(&largest, farthest);
    workgroupBarrier();
    let from_bits = atomicLoad(&least);
    return slicing(from_bits, max(atomicLoad(&largest), from_bits));
}

// Extends the boxes by the pixels of a thread. Each addition takes six atomics, so a run of pixels in one slice is
// added at once.
fn include_pixels(first: vec2u, slices: Slicing) {
    var slice = 0u;
    var low = vec3f(FLOAT_MAX);
    var high = vec3f(-FLOAT_MAX);
    for (var k = 0u; k < PIXELS; k += 1u) {
        let pixel = min(first + vec2u(0u, k), view.size - 1u);
        let bits = load_bits(pixel);
        if (bits == 0u) {
            continue;
        }
        let seen = bitcast<f32>(bits);
        if (SLICES > 1u && slice_of(slices, seen) != slice) {
            include(slice, low, high);
            slice = slice_of(slices, seen);
            low = vec3f(FLOAT_MAX);
            high = vec3f(-FLOAT_MAX);
        }
        let ray = pixel_ray(pixel);
        let position = ray.origin + ray.direction * seen;
        low = min(low, position);
        high = max(high, position);
    }
    include(slice, low, high);
}

@compute @workgroup_size(TILE_X, ROWS)
fn main(
    @builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_id) thread: vec3u, @builtin(local_invocation_index) index: u32
) {
    // Clear the boxes.
    if (index == 0u) {
        atomicStore(&least, 0xffffffffu);
        atomicStore(&largest, 0u);
    }
    if (index < 6u * SLICES) {
        atomicStore(&corners[index], select(0u, 0xffffffffu, index % 6u < 3u));
    }
    workgroupBarrier();

    let first = (group.xy * vec2u(1u, ROWS) + vec2u(0u, thread.y)) * vec2u(TILE_X, PIXELS) + vec2u(thread.x, 0u);
    var slices = Slicing(0u, 31u);
    if (SLICES > 1u) {
        slices = slice_tile(first);
    }
    include_pixels(first, slices);
    workgroupBarrier();

    // Store the corners, and beside them the tile's slicing.
    if (index < 2u * SLICES) {
        let corner = vec3f(
            decode_ordered(atomicLoad(&corners[3u * index])), decode_ordered(atomicLoad(&corners[3u * index + 1u])),
            decode_ordered(atomicLoad(&corners[3u * index + 2u])));
        let is_empty = atomicLoad(&corners[6u * (index / 2u)]) == 0xffffffffu;
        let slicing_word = select(slices.least, slices.shift, index % 2u == 1u);
        let empty_corner = select(FLOAT_MAX, -FLOAT_MAX, index % 2u == 1u);
        let tile = group.y * groups.x + group.x;
        bounds[2u * tile * SLICES + index] =
            vec4f(select(corner, vec3f(empty_corner), is_empty), bitcast<f32>(slicing_word));
    }
}
