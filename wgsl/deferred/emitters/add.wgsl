// One invocation adds the light of emitters to a pixel's other direct light: sum = direct + light times `emitter_tint`.
// All in W/(m2 sr).
#import "deferred/emitters/tint.wgsl"
#import "shared/gbuffer/load.wgsl"

@group(1) @binding(11) var<storage, read> direct: array<vec4f>;
@group(1) @binding(12) var<storage, read> light: array<vec4f>;
@group(1) @binding(13) var<storage, read_write> sum: array<vec4f>;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (any(id.xy >= view.size)) {
        return;
    }
    let index = id.y * view.size.x + id.x;
    let added = light[index].rgb;
    var total = direct[index];
    if (max3(added) > 0.0) {
        let surface = load_surface(id.xy);
        let tint = emitter_tint(gbuffer_brdf(surface), surface.normal, -pixel_ray(id.xy).direction);
        total = vec4f(total.rgb + added * tint, 1.0);
    }
    sum[index] = total;
}
