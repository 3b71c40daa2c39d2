// One invocation finds whether a given ray gets as far as its limit. See-through surfaces as in `reference/primary.wgsl`.
//
// rays, two elements each: origin, metres, relative to the scene's origin, and limit; direction, whose lengths the limit
// counts. Out: 1 where nothing lies before the limit, else 0.
#import "scene/trace.wgsl"

@group(1) @binding(11) var<storage, read> rays: array<vec4f>;
@group(1) @binding(12) var<storage, read_write> reached: array<u32>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (id.x >= arrayLength(&reached)) {
        return;
    }
    let origin = rays[2u * id.x];
    let hit = trace_firm(Ray(origin.xyz, rays[2u * id.x + 1u].xyz), origin.w);
    reached[id.x] = select(0u, 1u, hit.triangle == NONE);
}
