// Visibility between two surfaces by a march through voxels: each step looks at the slices that the ray passes within a
// cell, all at once, as bits of a word.
//
// The ends are lifted off their surfaces, along the normals, by what a voxel there spans in that direction: so no plane
// hides what lies before it, and what stands close to an end still does. Errs bright: within the lifts, between steps
// longer than a cell, in slices beyond the word of a step's middle; dark where two surfaces share a voxel.
// Who imports this declares `params` with grid_size, cell, and step, cells along the longer axis.
#import "ssil/voxels/range.wgsl"

@group(1) @binding(50) var<storage, read> voxels: array<u32>;
@group(1) @binding(51) var<storage, read> range: array<u32>;

// Lifts in voxels: with 1 a plane is just left. 320x180, one bounce, 16 frames, relMSE and bias with 1.5 and 1.75:
// Cornell's area light 0.0089, 0.0087 and -4.0, -3.8 %; spot 0.017, 0.016 and -2.1, -1.9 %; Sponza 3.2, 3.7 and -11.0,
// -8.6 %.
const LIFT: f32 = 1.75;
// What is left out at each end besides, cells. Chosen.
const END_CELLS: f32 = 0.5;
// Slices that a step passes at most: a word holds twice as many. Chosen.
const STEP_SLICES: f32 = 16.0;

var<private> slices: Slices;
var<private> border: vec2f;  // cells
var<private> centre: vec2f;  // of the picture, cells
var<private> forward: vec3f;
var<private> parallel: bool;
// What turns metres right and down into cells, at a depth of one metre.
var<private> cells_right: vec3f;
var<private> cells_down: vec3f;
// A voxel's sides times LIFT, likewise.
var<private> lift_right: vec3f;
var<private> lift_up: vec3f;
var<private> lift_forward: vec3f;

// Call this before all marches: loads in loops are dear.
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

// Returns where a ray to or from a surface ends: cells right and down, and what is linear along it over the picture,
// near / depth, or depth under parallel rays.
fn lifted(position: vec3f, normal: vec3f) -> vec3f {
    let spanned = abs(dot(normal, lift_right)) + abs(dot(normal, lift_up)) + abs(dot(normal, lift_forward));
    let place = position + normal * (spanned * select(dot(position, forward), 1.0, parallel));
    let depth = clamp(dot(place, forward), slices.near, slices.far);
    let per_depth = select(1.0 / depth, 1.0, parallel);
    let cell = vec2f(dot(place, cells_right), dot(place, cells_down)) * per_depth + centre;
    // All between two ends that lie in the grid does.
    return vec3f(clamp(cell, vec2f(0.0), border), select(slices.near * per_depth, depth, parallel));
}

// Returns 1 where nothing stands between two ends as `lifted` has them, else 0. `jitter` in [0, 1) shifts the steps.
fn march(start: vec3f, end: vec3f, jitter: f32) -> f32 {
    let way = end - start;
    let cells = max(max(abs(way.x), abs(way.y)), 1e-6);
    let gap = min(END_CELLS / cells, 0.5);
    let passed = slices.per_unit * abs(select(octaves(end.z) - octaves(start.z), way.z, parallel));
    let length = 1.0 - 2.0 * gap;
    let steps = 4.0 * max(ceil(0.25 * length * max(cells / params.step, passed / STEP_SLICES)), 1.0);
    let step = length / steps;
    // The slices that it passes in a cell, about as many in all of them.
    let half = 0.5 * passed * min(step, 1.0 / cells);
    // As many bits, and where they begin before the middle.
    let bits = 0xffffffffu >> (31u - u32(2.0 * half + 0.5));
    var k = 0.0;
    var hidden = false;
    // Left at its end: lavapipe goes through a loop once more to find that it is left at its beginning.
    loop {
        let t = gap + (vec4f(0.0, 1.0, 2.0, 3.0) + k + jitter) * step;
        let x = vec4u(start.x + t * way.x);
        let y = vec4u(start.y + t * way.y);
        let along = start.z + t * way.z;
        let slice = slices.per_unit * select(octaves(1.0) - octaves_of_four(along), along - slices.near, parallel);
        let word = vec4u(slice) >> vec4u(5u);
        let low = vec4i(floor(slice - half)) - vec4i(32u * word);
        let mask = select(vec4u(bits) << vec4u(low), vec4u(bits) >> vec4u(-low), low < vec4i(0));
        let index = (y * params.grid_size.x + x) * (BITS / 32u) + word;
        let found = vec4u(voxels[index.x], voxels[index.y], voxels[index.z], voxels[index.w]);
        hidden = any((found & mask) != vec4u(0u));
        k += 4.0;
        if (hidden || k >= steps) {
            break;
        }
    }
    return select(1.0, 0.0, hidden);
}
