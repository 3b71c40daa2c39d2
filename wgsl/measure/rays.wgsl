// Traces given rays: one invocation answers one, by the kernel that passes of the same kind use.
// rays: origin (metres, relative to the scene's origin) and limit; direction (the limit counts its lengths).
// result: closest: the triangle, NONE without a hit; any: 1 where something lies before the limit, else 0.
#import "scene/trace.wgsl"

@group(1) @binding(20) var<storage, read> rays: array<vec4f>;
@group(1) @binding(21) var<storage, read_write> result: array<u32>;

@compute @workgroup_size(64)
fn closest(@builtin(global_invocation_id) id: vec3u) {
    if (id.x < arrayLength(&result)) {
        let origin = rays[2u * id.x];
        result[id.x] = trace(Ray(origin.xyz, rays[2u * id.x + 1u].xyz), origin.w).triangle;
    }
}

@compute @workgroup_size(64)
fn any(@builtin(global_invocation_id) id: vec3u) {
    if (id.x < arrayLength(&result)) {
        let origin = rays[2u * id.x];
        result[id.x] = select(0u, 1u, trace_shadow(Ray(origin.xyz, rays[2u * id.x + 1u].xyz), origin.w).occluded_a);
    }
}
