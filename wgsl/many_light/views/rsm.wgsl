// One invocation shows a texel of a reflective shadow map: the maps of all lights side by side, over the whole picture.
//
// Out: position in metres relative to the scene's origin, normal, or reflected flux in W; 0 where no surface was hit.
#import "many_light/rsm/layout.wgsl"
#import "scene/info.wgsl"
#import "many_light/vpl/vpl.wgsl"

override KIND: u32 = 0u;  // 0 position, 1 normal, 2 flux

@group(1) @binding(11) var<storage, read> rsm_lights: array<RsmLight>;
@group(1) @binding(12) var<storage, read> rsm: array<vec4u>;
@group(1) @binding(13) var<storage, read_write> picture: array<vec4f>;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if (any(id.xy >= view.size)) {
        return;
    }
    let count = arrayLength(&rsm_lights);
    let columns = u32(ceil(sqrt(f32(count))));
    let rows = (count + columns - 1u) / columns;
    let cell = max(min(view.size.x / columns, view.size.y / rows), 1u);
    let place = id.xy / cell;
    let light = place.y * columns + place.x;
    var shown = vec3f(0.0);
    if (place.x < columns && light < count) {
        let map = rsm_lights[light];
        let texel = (id.xy % cell) * (1u << map.level) / cell;
        let number = map.first + number_of_texel(texel, map.level);
        let first = vpl_words() * number;
        let v = unpack_vpl(PackedVpl(rsm[first], rsm[first + 1u], vec4u(0u), vec4u(0u)));
        let seen = select(0.0, 1.0, v.area > 0.0);
        shown = seen * select(select(v.flux, v.normal, KIND == 1u), v.position, KIND == 0u);
    }
    picture[id.y * view.size.x + id.x] = vec4f(shown, 1.0);
}
