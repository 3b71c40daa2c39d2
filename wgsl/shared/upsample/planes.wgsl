// One invocation upsamples light to four pixels of the picture by joint bilateral upsampling, and reflects it.
//
// E = sum_k w_k E_k / sum_k w_k over the four pixels of the grid around the four, w_k of
// `shared/upsample/weights.wgsl`, the grid's surfaces by their depths and normals. Without a similar surface among
// them, more of the grid counts, by similarity alone. In: light of the grid, with depths; its normals; the coats'
// light; G-buffer. Out: reflected radiance, W/(m2 sr); or the light, with the pixels' depths and normals, and that of
// coats. The mean of a plane stays. Errs where no surface of the grid is similar: the least dissimilar ones count.
#import "shared/denoise/reflected.wgsl"
#import "shared/denoise/plane.wgsl"
#import "shared/upsample/grid_pixel.wgsl"
#import "shared/upsample/weights.wgsl"

override REFLECTED: bool = true;

@group(1) @binding(11) var<storage, read> light: array<vec4f>;    // W/m2; depth of `shared/denoise/plane.wgsl`
@group(1) @binding(12) var<storage, read> normals: array<u32>;    // of the same file
@group(1) @binding(13) var<storage, read> glossy: array<vec4f>;   // coats' light over their tint, W/(m2 sr)
@group(1) @binding(14) var<storage, read_write> fine: array<vec4f>;
@group(1) @binding(15) var<storage, read_write> fine_glossy: array<vec4f>;
@group(1) @binding(16) var<storage, read_write> fine_normals: array<u32>;

// Bilinear weights times similarities below this sum: more of the grid counts. Many-light, a frame of 320x180, relMSE
// with 0, 0.05, 0.3, 0.6, 1: Sponza 4.5, 4.3, 3.26, 3.18, 3.36, without the worst 0.1 % of its pixels .78, .66, .65,
// .66, .72; Cornell's point light .0112, .0150 with 0.3, 1.
const LEAST_REPRESENTED: f32 = 0.3;
// Pixels of the grid around a pixel that count then.
const REACH: i32 = 2;

// Returns the point of a pixel at a depth of `shared/denoise/plane.wgsl`, in the camera's frame.
fn view_position(pixel: vec2u, depth: f32) -> vec3f {
    let half = vec2f(length(view.right), length(view.up));
    let ndc = (vec2f(whole_pixel(pixel)) + view.offset) / vec2f(view.whole) * vec2f(2.0, -2.0) + vec2f(-1.0, 1.0);
    let parallel = view.orthographic != 0u;
    return select(vec3f(ndc * half, 1.0) / max(depth, 1e-37), vec3f(ndc * half, depth), parallel);
}

// Returns a surface of the grid, in the camera's frame.
fn load_tap(place: vec2u) -> GuideSurface {
    let index = place.y * grid_size().x + place.x;
    let depth = light[index].w;
    return GuideSurface(
        view_position(grid_pixel(place), depth), unpack_view_normal(normals[index]), depth > 0.0);
}

// Returns the place of a tap, 0 to 3, of which `first` is the upper left; at the picture's border, the nearest one.
fn tap_place(first: vec2i, offset: vec2i) -> vec2u {
    return vec2u(clamp(first + offset, vec2i(0), vec2i(grid_size()) - 1));
}

fn load_glossy(index: u32) -> vec3f {
    if (!HAS_COATS) {
        return vec3f(0.0);
    }
    return glossy[index].rgb;
}

// The weighted sum of the light of the grid, and of that of coats.
struct Sum {
    light: vec4f,   // w: sum of the weights
    coat: vec3f,
}

// Returns the light of similar surfaces of the grid around a pixel, weighted by similarity alone.
fn light_around(own: GuideSurface, first: vec2i, scale: f32) -> Sum {
    var sum = Sum(vec4f(0.0), vec3f(0.0));
    for (var y = 1 - REACH; y <= REACH; y += 1) {
        for (var x = 1 - REACH; x <= REACH; x += 1) {
            let place = tap_place(first, vec2i(x, y));
            let weight = similarity(own, load_tap(place), scale);
            let index = place.y * grid_size().x + place.x;
            sum.light += weight * vec4f(light[index].rgb, 1.0);
            sum.coat += weight * load_glossy(index);
        }
    }
    return sum;
}

fn store(pixel: vec2u, sum: Sum, depth: f32, normal: vec3f) {
    let inverse = 1.0 / max(sum.light.w, 1e-30);
    let color = sum.light.rgb * inverse;
    let coat = sum.coat * inverse;
    let index = pixel.y * view.size.x + pixel.x;
    if (REFLECTED) {
        fine[index] = vec4f(reflected(pixel, color, coat), 1.0);
        return;
    }
    fine[index] = vec4f(color, depth);
    fine_normals[index] = pack_view_normal(normal);
    if (HAS_COATS) {
        fine_glossy[index] = vec4f(coat, 1.0);
    }
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    // The four pixels lie right of and below the grid's pixel `first`, itself included.
    let first = vec2i(id.xy) - 1;
    let corner = first * i32(STRIDE) + vec2i(grid_corner());
    if (any(corner >= vec2i(view.size))) {
        return;
    }
    // Load the four surfaces of the grid around them, and their light.
    let places = array<vec2u, 4>(
        tap_place(first, vec2i(0, 0)), tap_place(first, vec2i(1, 0)), tap_place(first, vec2i(0, 1)),
        tap_place(first, vec2i(1, 1)));
    let a = load_tap(places[0]);
    let b = load_tap(places[1]);
    let c = load_tap(places[2]);
    let d = load_tap(places[3]);
    let size = grid_size();
    let at = vec4u(
        places[0].y * size.x + places[0].x, places[1].y * size.x + places[1].x, places[2].y * size.x + places[2].x,
        places[3].y * size.x + places[3].x);
    let colors = mat4x3f(light[at.x].rgb, light[at.y].rgb, light[at.z].rgb, light[at.w].rgb);
    let coats = mat4x3f(load_glossy(at.x), load_glossy(at.y), load_glossy(at.z), load_glossy(at.w));
    let exists = vec4<bool>(a.exists, b.exists, c.exists, d.exists);

    for (var k = 0u; k < 4u; k += 1u) {
        let step = vec2u(k & 1u, k >> 1u);
        let target_pixel = corner + vec2i(step);
        if (any(target_pixel < vec2i(0)) || any(target_pixel >= vec2i(view.size))) {
            continue;
        }
        // Compare the pixel's surface with them.
        let pixel = vec2u(target_pixel);
        let surface = load_surface(pixel);
        let seen = load_distance(pixel);
        let lit = seen > 0.0 && (surface.flags & GBUFFER_UNLIT) == 0u;
        let depth = select(0.0, plane_depth(pixel_ray(pixel), seen), lit);
        let own = GuideSurface(view_position(pixel, depth), to_view(surface.normal), lit);
        let width = 2.0 * length(view.right) * select(own.position.z, 1.0, view.orthographic != 0u);
        let scale = f32(view.whole.x) / max(width * f32(STRIDE), 1e-37);
        let similar = vec4f(
            similarity(own, a, scale), similarity(own, b, scale), similarity(own, c, scale), similarity(own, d, scale));
        let f = 0.5 * vec2f(step);
        let g = 1.0 - f;
        let bilinear = vec4f(g.x * g.y, f.x * g.y, g.x * f.y, f.x * f.y);
        // Sum their light.
        let weights = select(vec4f(0.0), (bilinear + WEIGHT_FLOOR) * (similar + WEIGHT_FLOOR), exists);
        var sum = Sum(vec4f(colors * weights, dot(weights, vec4f(1.0))), coats * weights);
        if (lit && dot(bilinear, similar) < LEAST_REPRESENTED) {
            let around = light_around(own, first, scale);
            sum.light += around.light;
            sum.coat += around.coat;
        }
        if (!lit) {
            sum = Sum(vec4f(0.0), vec3f(0.0));
        }
        store(pixel, sum, depth, surface.normal);
    }
}
