// One invocation divides the area of a VPL by the number of VPLs that share it: several lights and bounces may light
// the same surface. The area bounds the light of near VPLs, so it must be the VPL's own part of the surface.
//
// A'_k = A_k / max(1, sum_j [|x_j - x_k| < sqrt(2) r_j] / 2) over the VPLs j of similar normals, pi r_j^2 = A_j: the
// VPLs whose doubled discs cover it, halved. To save time only every n-th VPL is tested, and counts n times. In:
// resampled VPLs. Out: the same VPLs with areas that cover each surface about once, m2. Errs large: discs that reach
// over a surface's edge find too few VPLs. In a box lit by 40 lamps the areas sum to twice the walls' area, instead of
// 40 times.
#import "many_light/vpl/table.wgsl"

@group(1) @binding(11) var resampled: texture_storage_2d<rgba32uint, read>;
@group(1) @binding(12) var vpls: texture_storage_2d<rgba32uint, write>;
@group(1) @binding(19) var<uniform> params: Params;

struct Params {
    count: u32,   // of VPLs
    stride: u32,  // n
}

const GROUP: u32 = 64u;
// Area of a disc over its VPL's area. 2 is closer to the true areas than 4, with a thousand VPLs in one place
// (tests/analytic/test_gather.py) and with all bounces in the Cornell box.
const WIDENED: f32 = 2.0;
// Least cosine of similar normals: half-way between one wall and two walls at a right angle.
const SIMILAR_NORMALS: f32 = 0.5;

var<workgroup> discs: array<vec4f, GROUP>;  // position, squared radius
var<workgroup> normals: array<vec3f, GROUP>;

fn load_resampled(slot: u32) -> Vpl {
    let first = vpl_words() * slot;
    var packed: PackedVpl;
    packed.place = textureLoad(resampled, vpl_texel(first));
    packed.light = textureLoad(resampled, vpl_texel(first + 1u));
    if (HAS_LOBES) {
        packed.arriving = textureLoad(resampled, vpl_texel(first + 2u));
        packed.lobe = textureLoad(resampled, vpl_texel(first + 3u));
    }
    return unpack_vpl(packed);
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(local_invocation_index) thread: u32,
    @builtin(num_workgroups) groups: vec3u) {
    let slot = min(id.x, params.count - 1u);
    var v = load_resampled(slot);
    // Count the discs that cover the VPL; the workgroup loads 64 discs at a time.
    var covered = 0.0;
    for (var first = 0u; first < groups.x * GROUP; first += GROUP * params.stride) {
        let other = first + thread * params.stride;
        workgroupBarrier();
        let o = load_resampled(min(other, params.count - 1u));
        let squared_radius = f32(params.stride) * WIDENED * INV_PI * o.area;
        discs[thread] = vec4f(o.position, select(0.0, squared_radius, other < params.count));
        normals[thread] = o.normal;
        workgroupBarrier();
        for (var k = 0u; k < GROUP; k += 1u) {
            let between = discs[k].xyz - v.position;
            let inside = dot(between, between) < discs[k].w && dot(normals[k], v.normal) > SIMILAR_NORMALS;
            covered += select(0.0, 1.0 / WIDENED, inside);
        }
    }
    v.area /= max(covered, 1.0);
    if (id.x < params.count) {
        let packed = pack_vpl(v);
        let first = vpl_words() * slot;
        textureStore(vpls, vpl_texel(first), packed.place);
        textureStore(vpls, vpl_texel(first + 1u), packed.light);
        if (HAS_LOBES) {
            textureStore(vpls, vpl_texel(first + 2u), packed.arriving);
            textureStore(vpls, vpl_texel(first + 3u), packed.lobe);
        }
    }
}
