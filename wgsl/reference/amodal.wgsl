// One invocation follows the ray through the centre of one pixel to its end, and notes each instance that it meets.
//
// Out, for a band of rows: a bit for each instance and pixel; for each instance: the number of its pixels, and the largest
// width - x, height - y, x + 1 and y + 1 of them, of which the box follows. Alpha masks and see-through surfaces as in
// `reference/primary.wgsl`, whose hit is the first. Errs small: a surface less than 1e-5 of its distance from the eye, or
// from the scene's origin, behind another may be missed, and so is what lies behind MOST_HITS.
#import "scene/trace.wgsl"
#import "scene/ray_offset.wgsl"

struct Params {
    first_row: u32,
    rows: u32,   // of the band
    words: u32,  // of bits, for each instance
}

@group(1) @binding(11) var<storage, read_write> bits: array<atomic<u32>>;
@group(1) @binding(12) var<storage, read_write> boxes: array<atomic<u32>>;
@group(1) @binding(19) var<uniform> params: Params;

const MOST_HITS: u32 = 4096u;
const WORDS_OF_BOX: u32 = 5u;

fn note(instance: u32, pixel: vec2u) {
    let place = (pixel.y - params.first_row) * view.size.x + pixel.x;
    let bit = 1u << (place & 31u);
    if ((atomicOr(&bits[instance * params.words + place / 32u], bit) & bit) != 0u) {
        return;
    }
    let first = instance * WORDS_OF_BOX;
    atomicAdd(&boxes[first], 1u);
    atomicMax(&boxes[first + 1u], view.size.x - pixel.x);
    atomicMax(&boxes[first + 2u], view.size.y - pixel.y);
    atomicMax(&boxes[first + 3u], pixel.x + 1u);
    atomicMax(&boxes[first + 4u], pixel.y + 1u);
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let pixel = vec2u(id.x, id.y + params.first_row);
    if (id.y >= params.rows || any(pixel >= view.size)) {
        return;
    }
    let ray = camera_ray(vec2f(whole_pixel(pixel)) + 0.5);
    var travelled = 0.0;
    var advance = 0.0;
    var last = NONE;
    for (var hits = 0u; hits < MOST_HITS; hits += 1u) {
        let hit = trace_firm(Ray(ray.origin + ray.direction * travelled, ray.direction), FLOAT_MAX);
        if (hit.triangle == NONE) {
            break;
        }
        note(hit.instance, pixel);
        // Go on behind the hit; a triangle seen edge-on is met again until the advance leads past its plane.
        travelled += hit.distance;
        let point = ray.origin + ray.direction * travelled;
        let least = ray_offset(ANY_NORMAL, surface_terms(point) + abs(point - view.position));
        advance = select(least, 2.0 * advance, hit.triangle == last);
        travelled += advance;
        last = hit.triangle;
    }
}
