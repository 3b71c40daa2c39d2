// One invocation adds up the layers of one pixel and estimates how far their mean may be off.
//
// standard_error = sqrt(sum (x - mean)^2 / ((n - 1) n)), per channel; one sample alone says nothing of its spread, so then
// it is the value itself. Stratification makes the true error smaller (errs high). All in W/(m2 sr).

@group(1) @binding(0) var emission: texture_2d<f32>;   // a: number of samples
@group(1) @binding(1) var direct: texture_2d<f32>;
@group(1) @binding(2) var indirect: texture_2d<f32>;
@group(1) @binding(3) var deviation: texture_2d<f32>;
@group(1) @binding(4) var radiance: texture_storage_2d<rgba32float, write>;
@group(1) @binding(5) var standard_error: texture_storage_2d<rgba32float, write>;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let pixel = id.xy;
    if (any(pixel >= textureDimensions(emission))) {
        return;
    }
    let emitted = textureLoad(emission, pixel, 0);
    let total = emitted.rgb + textureLoad(direct, pixel, 0).rgb + textureLoad(indirect, pixel, 0).rgb;
    let n = emitted.a;
    var error = total;
    if (n > 1.5) {
        error = sqrt(textureLoad(deviation, pixel, 0).rgb / ((n - 1.0) * n));
    }
    textureStore(radiance, pixel, vec4f(total, 1.0));
    textureStore(standard_error, pixel, vec4f(error, 1.0));
}
