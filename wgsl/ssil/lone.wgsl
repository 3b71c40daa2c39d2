// One invocation lists a pixel of the picture that no pixel of the first level stands for: all four about it show other
// surfaces, so that what they got would leak to it. In: surfels of both levels. Out: the list, and as many workgroups
// as go through it.
#import "ssil/upsample.wgsl"

override SQUARE: u32 = 2u;

@group(1) @binding(13) var surfels: texture_storage_2d<rgba32uint, read>;
@group(1) @binding(14) var<storage, read_write> lone: array<u32>;                 // by their index
@group(1) @binding(15) var<storage, read_write> lone_groups: array<atomic<u32>>;  // x, y, z workgroups; pixels

// Workgroups of `gather.wgsl`, of LONE_GROUP threads, which go on with further pixels.
const MAX_GROUPS: u32 = 4096u;
const LONE_GROUP: u32 = 64u;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (any(id.xy >= view.size)) {
        return;
    }
    let index = id.y * view.size.x + id.x;
    let texel = textureLoad(surfels, id.xy);
    let size = vec2i(textureDimensions(coarse_surfels));
    let corner = vec2i(floor((vec2f(id.xy) + 0.5) / f32(SQUARE) - 0.5));
    let position = surfel_position(texel);
    let normal = surfel_normal(texel);
    let per_width = pixels_per_metre(position) * f32(size.x) / f32(view.size.x);
    var most = 0.0;
    for (var k = 0; k < 4; k += 1) {
        let other = textureLoad(coarse_surfels, vec2u(clamp(corner + vec2i(k & 1, k >> 1u), vec2i(0), size - 1)));
        most = max(most, select(sameness(position, normal, other, per_width), 0.0, is_empty(other)));
    }
    let is_lone = !is_empty(texel) && most <= LEAST;
    if (is_lone) {
        let slot = atomicAdd(&lone_groups[3], 1u);
        lone[slot] = index;
        atomicMax(&lone_groups[0], min(slot / LONE_GROUP + 1u, MAX_GROUPS));
        atomicStore(&lone_groups[1], 1u);
        atomicStore(&lone_groups[2], 1u);
    }
}
