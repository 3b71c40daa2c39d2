// One invocation upsamples light to a pixel of the picture: L = sum_k w_k L_k.
//
// In: light of coarse pixels, guide, G-buffer. Out: the same light, or with REFLECTED the radiance rho E / pi,
// W/(m2 sr), of irradiance in W/m2; 1 in w where there is a surface. Errs as `shared/upsample/weights.wgsl` does.
#import "shared/gbuffer/load.wgsl"
#import "shared/upsample/read.wgsl"

override REFLECTED: bool = false;

@group(1) @binding(13) var<storage, read_write> fine: array<vec4f>;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (any(id.xy >= view.size)) {
        return;
    }
    let index = id.y * view.size.x + id.x;
    let weights = load_guide(id.xy);
    let has_surface = dot(weights, vec4f(1.0)) > 0.0;
    let factor = select(vec3f(1.0), gbuffer_brdf(load_surface(id.xy)).diffuse * INV_PI, REFLECTED);
    fine[index] = vec4f(upsampled(id.xy, weights) * factor, select(0.0, 1.0, has_surface));
}
