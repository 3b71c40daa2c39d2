// One invocation finds how many virtual point lights share a place with one, since several lights and bounces may light
// the same surface, and lets it stand for as much less of it: what bounds near light is the piece of surface that a VPL
// stands for among all.
//
// area_k = A_k / max(1, sum_j [|x_j - x_k| < sqrt(2) r_j] / 2) over the VPLs j of like normals, pi r_j^2 = A_j: a disc of
// twice the area, counted half, sees others of its own kind in most places. Every n-th VPL stands for n.
//
// In: VPLs as they were drawn. Out: the same, with areas that cover each place about once, m2. Errs: discs that reach
// over a surface's edge count too few others, so areas stay too large there; in a box lit by 40 lamps they add up to
// twice that of its walls, instead of 40 times.
#import "many_light/vpl/table.wgsl"

@group(1) @binding(11) var drawn: texture_storage_2d<rgba32uint, read>;
@group(1) @binding(12) var vpls: texture_storage_2d<rgba32uint, write>;

@group(1) @binding(19) var<uniform> params: Params;

struct Params {
    count: u32,   // of VPLs
    stride: u32,  // of those that count
}

const GROUP: u32 = 64u;
// Area of a disc that looks for others, over its own. Closer to the truth than 4, with a thousand lights in one place
// (tests/analytic) and with all bounces in the Cornell box.
const WIDENED: f32 = 2.0;
// Of normals that are alike. Chosen.
const LIKE: f32 = 0.5;

var<workgroup> discs: array<vec4f, GROUP>;  // position, squared radius
var<workgroup> normals: array<vec3f, GROUP>;

fn load_drawn(slot: u32) -> Vpl {
    return unpack_vpl(textureLoad(drawn, vpl_texel(2u * slot)), textureLoad(drawn, vpl_texel(2u * slot + 1u)));
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(local_invocation_index) thread: u32,
    @builtin(num_workgroups) groups: vec3u) {
    let slot = min(id.x, params.count - 1u);
    var v = load_drawn(slot);
    var covered = 0.0;
    for (var first = 0u; first < groups.x * GROUP; first += GROUP * params.stride) {
        let other = first + thread * params.stride;
        workgroupBarrier();
        let o = load_drawn(min(other, params.count - 1u));
        let radius = select(0.0, f32(params.stride) * WIDENED * INV_PI * o.area, other < params.count);
        discs[thread] = vec4f(o.position, radius);
        normals[thread] = o.normal;
        workgroupBarrier();
        for (var k = 0u; k < GROUP; k += 1u) {
            let between = discs[k].xyz - v.position;
            let inside = dot(between, between) < discs[k].w && dot(normals[k], v.normal) > LIKE;
            covered += select(0.0, 1.0 / WIDENED, inside);
        }
    }
    v.area /= max(covered, 1.0);
    if (id.x < params.count) {
        textureStore(vpls, vpl_texel(2u * slot), pack_vpl_place(v));
        textureStore(vpls, vpl_texel(2u * slot + 1u), pack_vpl_light(v));
    }
}
