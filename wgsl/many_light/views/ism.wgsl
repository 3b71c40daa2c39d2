// One invocation shows the atlas of imperfect shadow maps, stretched over the picture: the least distance from the VPL,
// metres, among the texels that a pixel covers; 0 for none.
#import "many_light/ism/map.wgsl"

override SAMPLES: bool = false;   // show the samples before gaps are closed: texels, and rays at every RAY_SPACING
override RAY_SPACING: u32 = 0u;  // texels; 0: rays are in `samples`

@group(1) @binding(11) var atlas: texture_storage_2d<r32uint, read>;
@group(1) @binding(12) var<storage, read> samples: array<u32>;
@group(1) @binding(13) var<storage, read> ray_hits: array<vec4f>;
@group(1) @binding(14) var<storage, read_write> picture: array<vec4f>;

// Returns 1 / distance, 1/m.
fn inverse_distance(texel: u32) -> f32 {
    return select(0.0, 1.0 / code_distance(f32(texel >> 16u)), texel != 0u);
}

// Returns 1 / distance, 1/m, of a texel of the atlas or of its samples.
fn nearness(at: vec2u, size: vec2u) -> f32 {
    if (!SAMPLES) {
        return inverse_distance(textureLoad(atlas, at).r);
    }
    let index = at.y * size.x + at.x;
    // Read the splat or single texel, or the hit of the ray through the texel's corner.
    var found = 0.0;
    if (index < arrayLength(&samples)) {
        found = inverse_distance(samples[index]);
    }
    let inside = at % vec2u(ISM_RESOLUTION);
    if (RAY_SPACING > 0u && all(inside % vec2u(max(RAY_SPACING, 1u)) == vec2u(0u))) {
        let side = ISM_RESOLUTION / max(RAY_SPACING, 1u) + 1u;
        let map = at / ISM_RESOLUTION;
        let ray = inside / max(RAY_SPACING, 1u);
        let distance = ray_hits[3u * (((map.y * (size.x / ISM_RESOLUTION) + map.x) * side + ray.y) * side + ray.x)].w;
        found = max(found, select(0.0, 1.0 / distance, distance > 0.0));
    }
    return found;
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (any(id.xy >= view.size)) {
        return;
    }
    let size = textureDimensions(atlas);
    let scale = vec2f(size) / vec2f(view.size);
    let texels = max(scale.x, scale.y);
    let low = vec2u(vec2f(id.xy) * texels);
    let high = min(max(vec2u(vec2f(id.xy + 1u) * texels), low + 1u), size);
    var nearest = 0.0;
    for (var y = low.y; y < high.y; y += 1u) {
        for (var x = low.x; x < high.x; x += 1u) {
            nearest = max(nearest, nearness(vec2u(x, y), size));
        }
    }
    let distance = select(0.0, 1.0 / nearest, nearest > 0.0);
    picture[id.y * view.size.x + id.x] = vec4f(vec3f(distance), 1.0);
}
