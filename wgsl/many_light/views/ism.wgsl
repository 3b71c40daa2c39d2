// One invocation shows the nearest of those texels of the imperfect shadow maps that a pixel covers: the atlas over the
// whole picture, as its distance from its light in metres, 0 for nothing.
#import "many_light/ism/map.wgsl"

override DRAWN: bool = false;  // what was found before gaps were closed: single texels, and rays at every CELL texels
override CELL: u32 = 0u;       // 0: rays are texels, too

@group(1) @binding(11) var atlas: texture_storage_2d<r32uint, read>;
@group(1) @binding(12) var<storage, read> drawn: array<u32>;
@group(1) @binding(13) var<storage, read> near_points: array<vec4f>;
@group(1) @binding(14) var<storage, read_write> picture: array<vec4f>;

// Returns 1 / distance.
fn inverse_distance(texel: u32) -> f32 {
    return select(0.0, 1.0 / code_distance(f32(texel >> 16u)), texel != 0u);
}

fn nearness(at: vec2u, size: vec2u) -> f32 {
    if (!DRAWN) {
        return inverse_distance(textureLoad(atlas, at).r);
    }
    let index = at.y * size.x + at.x;
    var found = 0.0;
    if (index < arrayLength(&drawn)) {
        found = inverse_distance(drawn[index]);
    }
    let inside = at % vec2u(ISM_RESOLUTION);
    if (CELL > 0u && all(inside % vec2u(max(CELL, 1u)) == vec2u(0u))) {
        let side = ISM_RESOLUTION / max(CELL, 1u) + 1u;
        let map = at / ISM_RESOLUTION;
        let ray = inside / max(CELL, 1u);
        let distance = near_points[3u * (((map.y * (size.x / ISM_RESOLUTION) + map.x) * side + ray.y) * side + ray.x)].w;
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
