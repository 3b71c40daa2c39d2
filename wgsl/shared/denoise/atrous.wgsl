// One invocation filters a pixel by one level of an edge-avoiding a-trous wavelet filter, guided by variance.
//
// mean = sum_k h_k w_k x_k / sum_k h_k w_k over 3x3 pixels STEP apart, h = (1, 2, 1) (1, 2, 1), and
// w = w_plane w_normal max(1 - (l - l_k)^2 / (s^2 (v + v_k)), 0), l the mean luminance and v its variance (Dammertz et
// al. 2010, "Edge-Avoiding A-Trous Wavelet Transform for fast Global Illumination Filtering"; Schied et al. 2017,
// "Spatiotemporal Variance-Guided Filtering", eq. 3 to 5). The variance becomes sum (h w)^2 v / (sum h w)^2.
//
// Departures: both pixels' variances count, so that w is symmetric and keeps the energy (Schied's, with the centre's
// variance only, lose 4 % of the light of a corridor lit through doors); 3x3 taps of a wider step. In: light, W/m2, with
// depth; normals; guide. Out: the same, or with LAST reflected radiance, W/(m2 sr). Errs blurry where light changes by
// less than its noise.
#import "shared/denoise/reflected.wgsl"
#import "shared/denoise/guide.wgsl"

override STEP: u32 = 3u;
override LAST: bool = false;    // output radiance
override GUIDED: bool = false;  // there is a guide from the frames so far

@group(1) @binding(11) var<storage, read> light: array<vec4f>;
@group(1) @binding(12) var<storage, read> normals: array<u32>;
@group(1) @binding(13) var<storage, read_write> filtered: array<vec4f>;
@group(1) @binding(14) var<storage, read> glossy: array<vec4f>;
@group(1) @binding(17) var<storage, read> guide: array<vec2f>;
@group(1) @binding(18) var<storage, read_write> filtered_guide: array<vec2f>;

// s
const STANDARD_ERRORS: f32 = 1.5;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (any(id.xy >= grid_size())) {
        return;
    }
    let index = id.y * grid_size().x + id.x;
    let own = light[index];
    let own_guide = guide[index];
    let normal = unpack_view_normal(normals[index]) * PER_NORMAL;
    let plane = tangent_plane(grid_pixel(id.xy), own.w, unpack_view_normal(normals[index]));
    let scale = plane_scale(STEP * STRIDE);
    let across = plane.across * f32(STEP * STRIDE);

    var sum = vec4f(0.0);
    var variance = 0.0;
    for (var k = 0; k < 9; k += 1) {
        let offset = vec2i(k % 3, k / 3) - 1;
        let place = vec2i(id.xy) + offset * i32(STEP);
        let inside = all(place >= vec2i(0)) && all(place < vec2i(grid_size()));
        let tap_place = select(id.xy, vec2u(place), inside);
        let tap_index = tap_place.y * grid_size().x + tap_place.x;
        let tap = light[tap_index];
        let tap_guide = guide[tap_index];
        let off_plane = scale * (plane.at + dot(across, vec2f(offset)) - plane.factor * tap.w);
        let off_normal = PER_NORMAL - dot(normal, unpack_view_normal(normals[tap_index]));
        let apart = own_guide.x - tap_guide.x;
        let noise = (STANDARD_ERRORS * STANDARD_ERRORS) * (own_guide.y + tap_guide.y);
        let same_surface = max(1.0 - off_plane * off_plane - off_normal * off_normal, 0.0);
        let same_light = max(1.0 - apart * apart / max(noise, 1e-37), 0.0);
        let share = f32((2 - abs(offset.x)) * (2 - abs(offset.y)));
        let weight = select(0.0, share * same_surface * same_light, inside && min(tap.w, own.w) > 0.0);
        sum += weight * vec4f(tap.rgb, 1.0);
        variance += weight * weight * tap_guide.y;
    }
    // The pixel's own weight is close to 4 if there is something to light.
    let inverse = 1.0 / max(sum.w, 2.0);
    let color = sum.rgb * inverse;
    if (LAST) {
        var coat = vec3f(0.0);
        if (HAS_COATS) {
            coat = glossy[index].rgb;
        }
        filtered[index] = vec4f(reflected(id.xy, color, coat), 1.0);
        return;
    }
    filtered[index] = vec4f(color, own.w);
    let by_neighbours = vec2f(min(luminance(color), 1e18), variance * inverse * inverse);
    filtered_guide[index] = select(by_neighbours, own_guide, GUIDED & (sequence.still >= GUIDED_FROM));
}
