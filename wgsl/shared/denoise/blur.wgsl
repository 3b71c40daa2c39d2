// One invocation blurs four pixels along a row (or a column), edge-aware: the two passes together remove the pattern of
// interleaved sampling.
//
// mean = sum_k tent(k) w_plane w_normal x_k / sum of the weights. The tent of half-width n has the same sum over each
// class of pixels n apart, so an n-periodic pattern on a flat surface vanishes. Taps beyond the picture's border wrap
// back by n, which preserves this. In: light, W/m2, with depth; the coats' light; G-buffer. Out: the same, or in the
// last pass reflected radiance, W/(m2 sr); the guide of `atrous.wgsl`. Errs blurry where light changes within n pixels;
// some of the pattern remains at edges.
#import "shared/denoise/reflected.wgsl"
#import "shared/denoise/guide.wgsl"

override RADIUS: u32 = 4u;     // n; 1: no blur
override VERTICAL: bool = false;
override LAST: bool = false;   // output radiance
override GUIDED: bool = false; // compare mean light
override FILTERED: bool = false; // write the guide of the a-trous filter
override FIRST: bool = false;  // blur the first frame of a still picture only; `neighbours` has its guide
override RATIO: bool = false;  // output light over `glossy`
override LOBES: bool = false;  // the light is that of lobes: blur by no more than their width
override COAT_LOBES: bool = false; // blur the coats' light, not the other light, by no more than the lobes' width

@group(1) @binding(11) var<storage, read> light: array<vec4f>;
@group(1) @binding(12) var<storage, read> normals: array<u32>;
@group(1) @binding(13) var<storage, read_write> blurred: array<vec4f>;
@group(1) @binding(14) var<storage, read> glossy: array<vec4f>;
@group(1) @binding(15) var<storage, read_write> blurred_glossy: array<vec4f>;
@group(1) @binding(16) var<storage, read> neighbours: array<vec4f>;  // of `neighbours.wgsl`
// Three parts: the guide of the a-trous filter; the moments of the blurred luminance over the frames so far; x, the mean
// of squared luminance over a row.
@group(1) @binding(17) var<storage, read_write> guide: array<vec2f>;

// With a guide, neighbours also have weight 0 if their mean light differs by more than this many standard errors of
// both: of the pixels themselves, or of the 3x3 pixels around them. tools/README.md, "Constants".
const STANDARD_ERRORS: f32 = 3.0;
const STANDARD_ERRORS_AROUND: f32 = 2.5;

struct Center {
    normal: vec3f,
    depth: f32,
    plane: Plane,
    guide: vec4f,
    reach: f32,  // half-width of the tent, pixels
    coat_reach: f32,  // ... of the coats' light
}

fn load_neighbours(index: u32) -> vec4f {
    if (!GUIDED) {
        return vec4f(0.0);
    }
    return neighbours[index];
}

// Returns the number of pixels.
fn pixel_count() -> u32 {
    return grid_size().x * grid_size().y;
}

// Returns the squared luminance of a row's light, or its mean over the row.
fn load_square(index: u32, light: vec3f) -> f32 {
    if (!FILTERED) {
        return 0.0;
    }
    if (VERTICAL) {
        return guide[2u * pixel_count() + index].x;
    }
    let value = min(luminance(light), 1e18);
    return value * value;
}

// Returns the weights of a tap with the luminances `mean`, by those of four pixels; `noise`: variances of both.
fn same_light(means: vec4f, mean: f32, noise: vec4f, standard_errors: f32) -> vec4f {
    let apart = means - mean;
    return max(1.0 - apart * apart / max(noise * (standard_errors * standard_errors), vec4f(1e-37)), vec4f(0.0));
}

// Returns the half-width of a pixel's tent, pixels. On a flat mirror, the reflected rays of neighbours are a pixel's
// angle apart: a tent wider than the lobe's angle would blur what the lobe shows sharp, and narrow lobes are not noisy.
fn tent_reach(pixel: vec2u, lobes: bool) -> f32 {
    if (!lobes) {
        return f32(RADIUS);
    }
    let roughness = load_surface(grid_pixel(pixel)).roughness;
    let angle = 2.0 * length(view.right) / f32(view.whole.x);
    let lobe = 1.0 + roughness * roughness / angle;
    return select(min(lobe, f32(RADIUS)), f32(RADIUS), view.orthographic != 0u);
}

fn load_center(pixel: vec2u) -> Center {
    let inside = min(pixel, grid_size() - 1u);
    let index = inside.y * grid_size().x + inside.x;
    let normal = unpack_view_normal(normals[index]);
    let depth = light[index].w;
    return Center(
        normal, depth, tangent_plane(grid_pixel(inside), depth, normal), load_neighbours(index), tent_reach(inside, LOBES),
        tent_reach(inside, COAT_LOBES));
}

// Stores the guide of the a-trous filter; `square`: the mean of squared luminance over rows and columns.
fn store_guide(index: u32, color: vec3f, square: f32) {
    let value = min(luminance(color), 1e18);
    var found = vec2f(value, max(square - value * value, 0.0) / INDEPENDENT_PIXELS);
    if (GUIDED) {
        // Frame 0 starts over.
        let place = pixel_count() + index;
        let before = select(vec2f(0.0), guide[place], sequence.still > 0u);
        let now = before + (vec2f(value, value * value) - before) / f32(sequence.still + 1u);
        guide[place] = now;
        let variance = max(now.y - now.x * now.x, 0.0) / f32(max(sequence.still, 1u));
        found = select(found, vec2f(now.x, variance), sequence.still >= GUIDED_FROM);
    }
    guide[index] = found;
}

fn store(pixel: vec2u, sum: vec4f, shine: vec4f, depth: f32, square: f32) {
    if (any(pixel >= grid_size())) {
        return;
    }
    // The pixel's own weight is close to 1 if there is something to light.
    let inverse = 1.0 / max(sum.w, 0.5);
    let color = sum.rgb * inverse;
    let index = pixel.y * grid_size().x + pixel.x;
    let coat = shine.rgb / max(select(sum.w, shine.w, COAT_LOBES), 0.5);
    if (FILTERED && VERTICAL) {
        store_guide(index, color, square * inverse);
    } else if (FILTERED) {
        guide[2u * pixel_count() + index] = vec2f(square * inverse, 0.0);
    }
    if (LAST) {
        blurred[index] = vec4f(reflected(pixel, color, coat), 1.0);
    } else if (RATIO) {
        blurred[index] = vec4f(select(vec3f(0.0), color / max(coat, vec3f(1e-37)), coat > vec3f(0.0)), depth);
    } else {
        blurred[index] = vec4f(color, depth);
        if (HAS_COATS) {
            blurred_glossy[index] = vec4f(coat, 1.0);
        }
    }
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let step = select(vec2u(1u, 0u), vec2u(0u, 1u), VERTICAL);
    let first = id.xy * (1u + 3u * step);
    if (any(first >= grid_size())) {
        return;
    }
    // Later frames pass through. `first` varies: lavapipe compiles branches on uniforms alone anew for each dispatch.
    if (FIRST && ((sequence.still > 0u) & (first.x < view.size.x))) {
        for (var k = 0u; k < 4u; k += 1u) {
            let pixel = first + k * step;
            if (all(pixel < grid_size())) {
                blurred[pixel.y * grid_size().x + pixel.x] = light[pixel.y * grid_size().x + pixel.x];
            }
        }
        return;
    }
    // Load the four centres, and transpose their planes so that each tap is tested against all four at once.
    let a = load_center(first);
    let b = load_center(first + step);
    let c = load_center(first + 2u * step);
    let d = load_center(first + 3u * step);
    // Scale both tests so that they are 1 where a neighbour's weight reaches 0.
    let normal = transpose(mat4x3f(a.normal, b.normal, c.normal, d.normal)) * PER_NORMAL;
    let depth = vec4f(a.depth, b.depth, c.depth, d.depth);
    let per_pixel = plane_scale(RADIUS * STRIDE);
    let factor = vec4f(a.plane.factor, b.plane.factor, c.plane.factor, d.plane.factor) * per_pixel;
    let at = vec4f(a.plane.at, b.plane.at, c.plane.at, d.plane.at) * per_pixel;
    let across = transpose(mat4x2f(a.plane.across, b.plane.across, c.plane.across, d.plane.across));
    let slope = select(across[0], across[1], VERTICAL) * (per_pixel * f32(STRIDE));

    // Sum the taps of the row (or column). The weight is the tent times the test of plane and normal and, if guided,
    // that of means.
    let guides = transpose(mat4x4f(a.guide, b.guide, c.guide, d.guide));
    let reach = vec4f(a.reach, b.reach, c.reach, d.reach);
    let coat_reach = vec4f(a.coat_reach, b.coat_reach, c.coat_reach, d.coat_reach);
    let side = i32(RADIUS);
    let start = i32(dot(first, step));
    let end = i32(dot(grid_size(), step));
    var sum = mat4x4f();
    var shine = mat4x4f();
    var squares = vec4f(0.0);
    for (var k = 1 - side; k < 4 + side - 1; k += 1) {
        let place = start + k;
        let wrapped = place + select(0, side, place < 0) - select(0, side, place >= end);
        // A picture smaller than the tent has no such pixel.
        let inside = clamp(wrapped, 0, end - 1);
        let pixel = first - step * u32(start) + step * u32(inside);
        let index = pixel.y * grid_size().x + pixel.x;
        let tap = light[index];
        let tap_normal = unpack_view_normal(normals[index]);
        let off = abs(f32(k) - vec4f(0.0, 1.0, 2.0, 3.0));
        let tent = max(1.0 - off / reach, vec4f(0.0));
        let away = f32(wrapped - start) - vec4f(0.0, 1.0, 2.0, 3.0);
        let off_plane = at + slope * away - factor * tap.w;
        let off_normal = PER_NORMAL - (normal[0] * tap_normal.x + normal[1] * tap_normal.y + normal[2] * tap_normal.z);
        let kept = max(1.0 - off_plane * off_plane - off_normal * off_normal, vec4f(0.0));
        let lit = vec4<bool>((tap.w > 0.0) & (inside == wrapped)) & (depth > vec4f(0.0));
        var weight = tent * select(vec4f(0.0), kept, lit);
        if (GUIDED) {
            let tap_guide = load_neighbours(index);
            let own = same_light(guides[0], tap_guide.x, guides[1] + tap_guide.y, STANDARD_ERRORS);
            let around = same_light(guides[2], tap_guide.z, guides[3] + tap_guide.w, STANDARD_ERRORS_AROUND);
            weight *= select(min(own, around), vec4f(1.0), !FIRST & (sequence.still < GUIDED_FROM));
        }
        sum[0] += tap.r * weight;
        sum[1] += tap.g * weight;
        sum[2] += tap.b * weight;
        sum[3] += weight;
        squares += load_square(index, tap.rgb) * weight;
        if (HAS_COATS) {
            let coat = glossy[index];
            var coat_weight = weight;
            if (COAT_LOBES) {
                // Both tents are 1 at the pixel itself.
                coat_weight *= max(1.0 - off / coat_reach, vec4f(0.0)) / max(tent, vec4f(1e-3));
                shine[3] += coat_weight;
            }
            shine[0] += coat.r * coat_weight;
            shine[1] += coat.g * coat_weight;
            shine[2] += coat.b * coat_weight;
        }
    }
    let sums = transpose(sum);
    let shines = transpose(shine);
    store(first, sums[0], shines[0], a.depth, squares[0]);
    store(first + step, sums[1], shines[1], b.depth, squares[1]);
    store(first + 2u * step, sums[2], shines[2], c.depth, squares[2]);
    store(first + 3u * step, sums[3], shines[3], d.depth, squares[3]);
}
