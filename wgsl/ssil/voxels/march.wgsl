// Visibility between two surfaces by a march through voxels. A step tests all slices that the segment passes within a
// cell at once, as bits of a word.
//
// Both ends are lifted off their surfaces along the normals by a voxel's extent in that direction, so a plane does not
// occlude itself, but an occluder close to an end still counts. Errs bright within the lifts, between steps longer than
// a cell, and in slices of another 32-bit word than the step's midpoint; dark where two surfaces share a voxel. The
// importing shader declares `params` with grid_size, cell, and step (cells along the longer axis).
#import "ssil/voxels/slices.wgsl"

@group(1) @binding(50) var<storage, read> voxels: array<u32>;
@group(1) @binding(51) var<storage, read> range: array<u32>;

// Lift, voxels; 1 just leaves a plane. 320x180, one bounce, 16 frames, relMSE and bias with 1.5 and 1.75:
// Cornell's area light 0.0089, 0.0087 and -4.0, -3.8 %; spot 0.017, 0.016 and -2.1, -1.9 %; Sponza 3.2, 3.7 and -11.0,
// -8.6 %.
const LIFT: f32 = 1.75;
// Length also skipped at each end, cells: a segment from a cell's middle leaves the cell after half a cell.
const END_CELLS: f32 = 0.5;
// Most slices per step: half of a word's bits, so that any middle in the word has room on one side.
const STEP_SLICES: f32 = 16.0;

var<private> slices: Slices;
var<private> border: vec2f;  // cells
var<private> centre: vec2f;  // of the picture, cells
var<private> forward: vec3f;
var<private> parallel: bool;
// Metres to cells, right and down, at a depth of 1 m.
var<private> cells_right: vec3f;
var<private> cells_down: vec3f;
// Sides of a voxel times LIFT, at a depth of 1 m.
var<private> lift_right: vec3f;
var<private> lift_up: vec3f;
var<private> lift_forward: vec3f;

// Loads the grid; call it once before the marches of an invocation.
fn prepare_march() {
    slices = slices_of(range[0], range[1]);
    border = vec2f(params.grid_size) - 0.01;
    centre = vec2f(view.size) * (0.5 / params.cell);
    forward = view.forward;
    parallel = view.orthographic != 0u;
    cells_right = view.right * (centre.x / dot(view.right, view.right));
    cells_down = view.up * (-centre.y / dot(view.up, view.up));
    let side = 2.0 * params.cell * LIFT / f32(view.size.x);
    lift_right = view.right * side;
    lift_up = normalize(view.up) * (length(view.right) * side);
    lift_forward = view.forward * (LIFT / slices.per_unit);
}

// Returns a segment's lifted end: cells right and down, and near / depth (or depth under parallel rays), which is
// linear along the segment in the picture.
fn lifted(position: vec3f, normal: vec3f) -> vec3f {
    let spanned = abs(dot(normal, lift_right)) + abs(dot(normal, lift_up)) + abs(dot(normal, lift_forward));
    let place = position + normal * (spanned * select(dot(position, forward), 1.0, parallel));
    let depth = clamp(dot(place, forward), slices.near, slices.far);
    let per_depth = select(1.0 / depth, 1.0, parallel);
    let cell = vec2f(dot(place, cells_right), dot(place, cells_down)) * per_depth + centre;
    // A segment between two points of the grid stays in it.
    return vec3f(clamp(cell, vec2f(0.0), border), select(slices.near * per_depth, depth, parallel));
}

// Returns 1 if no voxel is set between two ends from `lifted`, else 0. `jitter` in [0, 1) shifts the steps.
fn march(start: vec3f, end: vec3f, jitter: f32) -> f32 {
    let way = end - start;
    let cells = max(max(abs(way.x), abs(way.y)), 1e-6);
    let gap = min(END_CELLS / cells, 0.5);
    let passed = slices.per_unit * abs(select(octaves(end.z) - octaves(start.z), way.z, parallel));
    let length = 1.0 - 2.0 * gap;
    let steps = 4.0 * max(ceil(0.25 * length * max(cells / params.step, passed / STEP_SLICES)), 1.0);
    let step = length / steps;
    // Half of the slices that the segment passes in a cell.
    let half = 0.5 * passed * min(step, 1.0 / cells);
    // One bit per slice.
    let bits = 0xffffffffu >> (31u - u32(2.0 * half + 0.5));
    var k = 0.0;
    var hidden = false;
    // Test at the loop's end: lavapipe runs one more iteration if the test is at the beginning.
    loop {
        let t = gap + (vec4f(0.0, 1.0, 2.0, 3.0) + k + jitter) * step;
        let x = vec4u(start.x + t * way.x);
        let y = vec4u(start.y + t * way.y);
        let along = start.z + t * way.z;
        let slice = slices.per_unit * select(octaves(1.0) - octaves_of_four(along), along - slices.near, parallel);
        let word = vec4u(slice) >> vec4u(5u);
        let low = vec4i(floor(slice - half)) - vec4i(32u * word);
        let mask = select(vec4u(bits) << vec4u(low), vec4u(bits) >> vec4u(-low), low < vec4i(0));
        let index = (y * params.grid_size.x + x) * (SLICES / 32u) + word;
        let found = vec4u(voxels[index.x], voxels[index.y], voxels[index.z], voxels[index.w]);
        hidden = any((found & mask) != vec4u(0u));
        k += 4.0;
        if (hidden || k >= steps) {
            break;
        }
    }
    return select(1.0, 0.0, hidden);
}
