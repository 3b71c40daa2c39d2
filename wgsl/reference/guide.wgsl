// Where the light rays of adaptive runs go: to those of a light's rays whose light reaches the picture by reflection.
//
// The rays of a punctual light or a sun are a unit square: of directions, or of places on a disc that covers the scene.
// Its cells get rays in proportion to the indirect light that the runs before found through them, relative to the mean
// of the pixel, and a share of uniform rays (after Vorba et al. 2014, section 5). Departures: histograms, not mixtures
// of Gaussians; emitters, environments, and lights after the first GUIDED_LIGHTS send uniform rays.
#import "scene/lights.wgsl"
#import "reference/learned.wgsl"

// Suns, points and spots; compiled out if the scene has none.
override HAS_PUNCTUAL_LIGHTS: bool = true;

const GUIDED_LIGHTS: u32 = 16u;
const SIDE: u32 = 32u;
const CELLS: u32 = SIDE * SIDE;
// Words of a grid: light that the last run found by cell, an integer; that all runs found; density of rays, 1: uniform;
// the probability up to each cell's end in its row, and up to each row's end.
const FOUND: u32 = 0u;
const ALL_FOUND: u32 = CELLS;
const DENSITY: u32 = 2u * CELLS;
const UP_TO_CELL: u32 = 3u * CELLS;
const UP_TO_ROW: u32 = 4u * CELLS;
const GRID_WORDS: u32 = 4u * CELLS + SIDE;
// Of the integers: found light that equals the pixel's mean, and the largest, so that single paths do not rule.
const FOUND_UNIT: f32 = 16.0;
const MOST_FOUND: f32 = 64.0 * FOUND_UNIT;

// What the paths of a pixel use of the grids.
struct Guide {
    own: u32,        // word where its half's grids begin, which record
    followed: u32,   // word where those begin that its rays follow: its own in pilot runs, then the other half's
    learned: bool,   // false: rays are uniform
    unit: f32,       // of found light, in 1 / radiance
}

// A point of a light's square.
struct GuidedPoint {
    u: vec2f,
    density: f32,  // relative to uniform points
    cell: u32,     // word from the start of a half's grids
}

// Returns the guide of a pixel in a run; `mean`: its radiance so far.
fn guide_of(pixel: vec2u, run: u32, mean: vec3f) -> Guide {
    let half = half_of(pixel);
    let followed = select(1u - half, half, run < PILOT_RUNS);
    let words = GUIDED_LIGHTS * GRID_WORDS;
    // As in relMSE, a tenth of the picture's mean bounds the weight of dark pixels.
    let brightness = max(luminance(mean), 0.1 * learned_float(MEANS + followed));
    return Guide(
        GUIDE_START + half * words, GUIDE_START + followed * words, run > 0u,
        FOUND_UNIT / max(brightness, 1e-37));
}

fn is_guided(number: u32, kind: u32) -> bool {
    return number < GUIDED_LIGHTS && (kind == KIND_POINT || kind == KIND_SPOT || kind == KIND_SUN);
}

// Returns the place of the first of SIDE ascending values that exceeds x; they start at a word.
fn first_above(start: u32, x: f32) -> u32 {
    var low = 0u;
    var high = SIDE - 1u;
    while (low < high) {
        let middle = (low + high) / 2u;
        if (learned_float(start + middle) > x) {
            high = middle;
        } else {
            low = middle + 1u;
        }
    }
    return low;
}

// Returns the cell of a point in a light's square: a word from the start of a half's grids.
fn cell_of(number: u32, u: vec2f) -> u32 {
    let cell = vec2u(clamp(u * f32(SIDE), vec2f(0.0), vec2f(f32(SIDE) - 1.0)));
    return number * GRID_WORDS + cell.x * SIDE + cell.y;
}

// Maps a uniform point to the square of a light, with the density of its cells.
fn guided_point(guide: Guide, number: u32, u: vec2f) -> GuidedPoint {
    if (!guide.learned) {
        return GuidedPoint(u, 1.0, cell_of(number, u));
    }
    let grid = guide.followed + number * GRID_WORDS;
    let row = first_above(grid + UP_TO_ROW, u.x);
    let cells = grid + UP_TO_CELL + row * SIDE;
    let column = first_above(cells, u.y);
    let place = vec2u(row, column);
    let before = max(place, vec2u(1u)) - 1u;
    let start = select(
        vec2f(0.0), vec2f(learned_float(grid + UP_TO_ROW + before.x), learned_float(cells + before.y)),
        place > vec2u(0u));
    let end = vec2f(learned_float(grid + UP_TO_ROW + row), learned_float(cells + column));
    let within = clamp((u - start) / (end - start), vec2f(0.0), vec2f(BELOW_ONE));
    return GuidedPoint(
        min((vec2f(place) + within) / f32(SIDE), vec2f(BELOW_ONE)),
        learned_float(grid + DENSITY + row * SIDE + column), number * GRID_WORDS + row * SIDE + column);
}

// Returns the cell of a light's rays that arrive at a position; NONE: the light is not guided.
fn cell_towards(light: Light, number: u32, position: vec3f) -> u32 {
    if (!is_guided(number, light.kind)) {
        return NONE;
    }
    // Invert `sample_ray_of`.
    var local: vec3f;
    var u: vec2f;
    if (light.kind == KIND_SUN) {
        local = (position - scene.centre) * frame_from_normal(-light.edge1);
        u.x = dot(local.xy, local.xy) / max(scene.radius * scene.radius, 1e-37);
    } else {
        local = normalize_or(position - light.position, vec3f(1.0, 0.0, 0.0));
        if (light.kind == KIND_SPOT) {
            local = local * frame_from_normal(light.edge1);
        }
        u.x = (1.0 - local.z) * TWO_PI * direction_density(light);
    }
    u.y = fract(atan2(local.y, local.x) / TWO_PI);
    return cell_of(number, u);
}

// Returns the density of light rays in a cell, relative to uniform ones.
fn guide_density(guide: Guide, cell: u32) -> f32 {
    if (!guide.learned || cell == NONE) {
        return 1.0;
    }
    return learned_float(guide.followed + DENSITY + cell);
}

// Records indirect light that came to the picture through a cell; the first run knows no means yet and counts paths.
fn record_found(guide: Guide, cell: u32, light: vec3f) {
    if (cell != NONE) {
        let amount = select(FOUND_UNIT, min(luminance(light) * guide.unit, MOST_FOUND), guide.learned);
        atomicAdd(&learned[guide.own + FOUND + cell], u32(amount + 0.5));
    }
}
