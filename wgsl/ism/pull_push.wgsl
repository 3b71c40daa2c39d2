// One workgroup closes the gaps between the single texels of 64 x 64 of the atlas: the pull and the push phase of
// Marroquim et al. 2007, "Efficient Point-Based Rendering Using Image Reconstruction", with both pyramids in workgroup
// memory.
//
// Pull: an element is the mean of those of its four children that lie within the depth interval of the nearest one, of
// where they are, too. Push: an element that is empty, or lies behind the interval of
// what surrounds it, becomes the weighted mean (9, 3, 3, 1) of the four coarser ones around it whose points reach it.
//
// In: single texels. Out: the atlas. A tile holds several small maps or a part of a large one; nothing crosses the
// border of a map or of a tile. Errs dark at silhouettes, by a point's radius and
// more, and bright where points are farther apart.
#import "ism/map.wgsl"
#import "ism/radius.wgsl"

@group(1) @binding(11) var<storage, read> drawn: array<u32>;
@group(1) @binding(12) var atlas: texture_storage_2d<r32uint, write>;

override REACH: f32 = 1.0;     // how far a point reaches, over its radius
override INTERVAL: f32 = 1.2;  // depth interval, over a point's radius

const TILE: u32 = 64u;
const LEVELS: u32 = 6u;        // the last is a single element
const THREADS: u32 = 256u;

// Levels 1 to 6, one after the other: the mean of points, and where it lies, in atlas texels from the element's centre.
var<workgroup> pyramid: array<u32, 1365>;
var<workgroup> places: array<u32, 1365>;

struct Element {
    texel: u32,
    place: vec2f,
}

fn level_start(level: u32) -> u32 {
    return (4096u - (4096u >> (2u * level - 2u))) / 3u;
}

fn load_drawn(tile: vec2u, at: vec2u) -> u32 {
    return drawn[(tile.y + at.y) * ISM_COLUMNS * ISM_RESOLUTION + tile.x + at.x];
}

fn load_element(level: u32, at: vec2u) -> Element {
    let index = level_start(level) + at.y * (TILE >> level) + at.x;
    return Element(pyramid[index], unpack2x16float(places[index]));
}

// Returns the depth interval in codes: a share r of the distance are 2 log2(1 + r) octaves of its square.
fn interval_codes(code: f32) -> f32 {
    return 2.885 * CODES_PER_OCTAVE * INTERVAL * point_radius(code) * (2.5 / f32(ISM_RESOLUTION));
}

// Returns a texel with the slopes of another.
fn with_slopes(code: f32, slopes: vec2f) -> u32 {
    let steps = vec2u(vec2i(round(slopes))) & vec2u(0xffu);
    return (u32(clamp(code + 0.5, 1.0, 65535.0)) << 16u) | (steps.x << 8u) | steps.y;
}

// Returns a child, with its place from its parent's centre.
fn load_child(tile: vec2u, level: u32, at: vec2u, step: vec2u) -> Element {
    var child: Element;
    if (level == 1u) {
        child = Element(load_drawn(tile, 2u * at + step), vec2f(0.0));
    } else {
        child = load_element(level - 1u, 2u * at + step);
    }
    child.place += 0.25 * f32(1u << level) * (2.0 * vec2f(step) - 1.0);
    return child;
}

fn pull(tile: vec2u, level: u32, at: vec2u) {
    let a = load_child(tile, level, at, vec2u(0u, 0u));
    let b = load_child(tile, level, at, vec2u(1u, 0u));
    let c = load_child(tile, level, at, vec2u(0u, 1u));
    let d = load_child(tile, level, at, vec2u(1u, 1u));
    let index = level_start(level) + at.y * (TILE >> level) + at.x;
    let codes = vec4f(vec4u(a.texel, b.texel, c.texel, d.texel) >> vec4u(16u));
    let front = max(max(codes.x, codes.y), max(codes.z, codes.w));
    let near = (codes > vec4f(0.0)) & (codes >= vec4f(front - interval_codes(front)));
    let mean = weighted_mean(
        select(vec4f(0.0), vec4f(1.0), near), codes, a.place, b.place, c.place, d.place, texel_slopes(a.texel),
        texel_slopes(b.texel), texel_slopes(c.texel), texel_slopes(d.texel));
    pyramid[index] = mean.texel;
    places[index] = pack2x16float(mean.place);
}

// Returns the mean of four points; empty where all weights are zero.
fn weighted_mean(
    weights: vec4f, codes: vec4f, place_a: vec2f, place_b: vec2f, place_c: vec2f, place_d: vec2f, slopes_a: vec2f,
    slopes_b: vec2f, slopes_c: vec2f, slopes_d: vec2f
) -> Element {
    let total = dot(weights, vec4f(1.0));
    let w = weights / max(total, 1.0);
    let slopes = w.x * slopes_a + w.y * slopes_b + w.z * slopes_c + w.w * slopes_d;
    let place = w.x * place_a + w.y * place_b + w.z * place_c + w.w * place_d;
    return Element(select(0u, with_slopes(dot(w, codes), slopes), total > 0.0), place);
}

struct Coarse {
    code: f32,      // 0: it does not reach the finer element
    place: vec2f,   // from the finer element's centre, in atlas texels
    slopes: vec2f,
}

fn load_coarse(level: u32, at: vec2u, step: vec2i) -> Coarse {
    let coarse = level + 1u;
    let size = f32(1u << level);
    let map_shift = firstTrailingBit(min(ISM_RESOLUTION, TILE)) - coarse;
    let nearest = at >> vec2u(1u);
    let other = vec2i(nearest) + step * (vec2i(at & vec2u(1u)) * 2 - 1);
    // Negative ones are large as unsigned.
    let inside = all((vec2u(other) >> vec2u(map_shift)) == (nearest >> vec2u(map_shift)));
    let element = load_element(coarse, select(nearest, vec2u(other), inside));
    let place = element.place + size * (2.0 * vec2f(other) - vec2f(at) + 0.5);
    // Texels of the finer element are up to half of its diagonal away from its centre.
    let reach = REACH * point_radius(f32(element.texel >> 16u)) + 0.7 * (size - 1.0);
    let counts = inside & (element.texel != 0u) & (dot(place, place) <= reach * reach);
    // Planes are drawn out to the texels themselves, at the end.
    let code = texel_code(element.texel, select(vec2f(0.0), -place, level == 0u));
    return Coarse(select(0.0, max(code, 1.0), counts), place, texel_slopes(element.texel));
}

// Returns an element of a level, given what was pulled, from the coarser level.
fn push(level: u32, at: vec2u, own: Element) -> Element {
    let a = load_coarse(level, at, vec2i(0, 0));
    let b = load_coarse(level, at, vec2i(1, 0));
    let c = load_coarse(level, at, vec2i(0, 1));
    let d = load_coarse(level, at, vec2i(1, 1));
    let codes = vec4f(a.code, b.code, c.code, d.code);
    let front = max(max(codes.x, codes.y), max(codes.z, codes.w));
    let near = (codes > vec4f(0.0)) & (codes >= vec4f(front - interval_codes(front)));
    let mean = weighted_mean(
        select(vec4f(0.0), vec4f(9.0, 3.0, 3.0, 1.0), near), codes, a.place, b.place, c.place, d.place, a.slopes,
        b.slopes, c.slopes, d.slopes);
    let before = f32(mean.texel >> 16u) - interval_codes(f32(mean.texel >> 16u));
    if (mean.texel == 0u || (own.texel != 0u && f32(own.texel >> 16u) >= before)) {
        return own;
    }
    return mean;
}

@compute @workgroup_size(256)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) thread: u32) {
    let tile = group.xy * TILE;
    let last = min(firstTrailingBit(ISM_RESOLUTION), LEVELS);
    for (var level = 1u; level <= last; level += 1u) {
        let side = TILE >> level;
        for (var i = thread; i < side * side; i += THREADS) {
            pull(tile, level, vec2u(i % side, i / side));
        }
        workgroupBarrier();
    }
    for (var level = last - 1u; level >= 1u; level -= 1u) {
        let side = TILE >> level;
        for (var i = thread; i < side * side; i += THREADS) {
            let index = level_start(level) + i;
            let at = vec2u(i % side, i / side);
            let element = push(level, at, load_element(level, at));
            pyramid[index] = element.texel;
            places[index] = pack2x16float(element.place);
        }
        workgroupBarrier();
    }
    for (var i = thread; i < TILE * TILE; i += THREADS) {
        let at = vec2u(i % TILE, i / TILE);
        textureStore(atlas, tile + at, vec4u(push(0u, at, Element(load_drawn(tile, at), vec2f(0.0))).texel));
    }
}
