// One invocation computes the irradiance of a pixel of the picture, or with REFLECTED the indirect radiance,
// L = rho / pi E T(w_o) + L_coat, W/(m2 sr).
//
// In: G-buffer; irradiance of the first level and its upsampling guide, or with UPSAMPLED irradiance of the picture;
// irradiance of unrepresented pixels; L_coat over coat_tint(), of each pixel of the picture. Errs as
// `shared/upsample/weights.wgsl` does.
#import "shared/gbuffer/load.wgsl"
#import "common/coat.wgsl"
#import "common/lobes.wgsl"
#import "shared/upsample/read.wgsl"
#import "shared/upsample/unrepresented.wgsl"

override UPSAMPLED: bool = false;  // `coarse` has the irradiance of each pixel of the picture
override HAS_GLOSSY: bool = false;
override REFLECTED: bool = true;

@group(1) @binding(13) var<storage, read> glossy: array<vec4f>;
@group(1) @binding(14) var<storage, read_write> full: array<vec4f>;
@group(1) @binding(15) var<storage, read> unrepresented_irradiance: array<vec4f>;

// Returns the irradiance of a pixel, or its reflected radiance.
fn lit(pixel: vec2u, surface: GbufferSurface, irradiance: vec3f) -> vec4f {
    var light = irradiance;
    if (REFLECTED) {
        let brdf = gbuffer_brdf(surface);
        light *= brdf.diffuse * INV_PI;
        if (HAS_COATS) {
            // The base gets what the coat transmits, in the mean over the hemisphere: T(w_o).
            let to_eye = -pixel_ray(pixel).direction;
            light *= loss_to_eye(brdf, surface.normal, to_eye).transmitted;
            if (HAS_CLEARCOAT || HAS_SHEEN) {
                light *= left_for_base(brdf, to_eye * frame_from_normal(surface.normal)).scattered;
            }
            if (HAS_GLOSSY && brdf.glossy) {
                light += glossy[pixel.y * view.size.x + pixel.x].rgb * coat_tint(brdf, surface.normal, to_eye);
            }
        }
    }
    return vec4f(light, 1.0);
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (any(id.xy >= view.size)) {
        return;
    }
    let index = id.y * view.size.x + id.x;
    let surface = load_surface(id.xy);
    if (load_distance(id.xy) <= 0.0 || (surface.flags & GBUFFER_UNLIT) != 0u) {
        full[index] = vec4f(0.0);
        return;
    }
    var weights = vec4f(1.0, 0.0, 0.0, 0.0);
    if (COARSE_STRIDE > 1u && !UPSAMPLED) {
        weights = load_guide(id.xy);
    }
    var irradiance = vec3f(0.0);
    if (UPSAMPLED || COARSE_STRIDE == 1u) {
        irradiance = coarse[index].rgb;
    } else {
        irradiance = upsampled(id.xy, weights);
    }
    full[index] = lit(id.xy, surface, irradiance);
}

// Does the same for the list of unrepresented pixels.
@compute @workgroup_size(LIST_GROUP)
fn listed(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let count = unrepresented_count();
    for (var slot = id.x; slot < count; slot += groups.x * LIST_GROUP) {
        let index = unrepresented[slot];
        let pixel = vec2u(index % view.size.x, index / view.size.x);
        let surface = load_surface(pixel);
        if ((surface.flags & GBUFFER_UNLIT) == 0u) {
            full[index] = lit(pixel, surface, unrepresented_irradiance[index].rgb);
        }
    }
}
