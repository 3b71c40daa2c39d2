// One invocation adds what a pixel reflects of the light of shiny surfaces: L += rho / pi E T(w_o), W/(m2 sr).
//
// In: G-buffer; E of `ssil/shiny.wgsl`, filtered, W/m2. In and out: the picture's indirect light. Exact.
#import "shared/gbuffer/load.wgsl"
#import "common/coat.wgsl"

@group(1) @binding(13) var<storage, read> shiny: array<vec4f>;
@group(1) @binding(14) var<storage, read_write> full: array<vec4f>;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (any(id.xy >= view.size)) {
        return;
    }
    let index = id.y * view.size.x + id.x;
    let surface = load_surface(id.xy);
    if (load_distance(id.xy) <= 0.0 || (surface.flags & GBUFFER_UNLIT) != 0u) {
        return;
    }
    let brdf = gbuffer_brdf(surface);
    let transmitted = loss_to_eye(brdf, surface.normal, -pixel_ray(id.xy).direction).transmitted;
    full[index] = vec4f(full[index].rgb + shiny[index].rgb * brdf.diffuse * (INV_PI * transmitted), 1.0);
}
