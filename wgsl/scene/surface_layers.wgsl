// The layers of a material at a hit.
#import "common/layers.wgsl"
#import "scene/tangent_frame.wgsl"

// The place of a hit on a material's textures.
struct LayerPlace {
    material: u32,
    textured: bool,
    uv0: vec2f,
    uv1: vec2f,
    covered: UvFootprint,
    is_point: bool,
}

fn has_layer_map(p: LayerPlace, slot: u32) -> bool {
    return HAS_LAYER_MAPS && p.textured && has_texture(p.material, slot);
}

// Returns a texture's value, or 1 without a texture.
fn layer_texel(p: LayerPlace, slot: u32) -> vec4f {
    if (has_layer_map(p, slot)) {
        return read_texture(p.material, slot, p.uv0, p.uv1, p.covered, p.is_point);
    }
    return vec4f(1.0);
}

// Returns the layers. `normal`: unit, of the vertices, as is the clear coat's, which is not turned to the viewer yet.
fn material_layers(
    triangle: Triangle, corners: Corners, instance: u32, normal: vec3f, textured: bool, footprint: HitFootprint
) -> Layers {
    let m = triangle.material;
    var p = LayerPlace(m, textured, vec2f(0.0), vec2f(0.0), UvFootprint(vec4f(0.0), vec4f(0.0), 1.0), true);
    if (HAS_LAYER_MAPS && textured) {
        p = LayerPlace(
            m, true, texcoord0_at(corners), texcoord1_at(corners), uv_footprint(corners, footprint), footprint.is_point);
    }
    var l = no_layers();
    l.clearcoat_normal = normal;
    if (HAS_SPECULAR) {
        // KHR_materials_specular: F0 = min(((ior - 1) / (ior + 1))^2 color, 1) specular.
        l.f90 = materials[m].specular * layer_texel(p, SPECULAR_SLOT).a;
        let tint = materials[m].specular_color * layer_texel(p, SPECULAR_COLOR_SLOT).rgb;
        l.f0 = min(materials[m].dielectric_f0 * tint, vec3f(1.0)) * l.f90;
        l.ior = materials[m].ior;
    }
    if (HAS_CLEARCOAT) {
        l.clearcoat = materials[m].clearcoat * layer_texel(p, CLEARCOAT_SLOT).r;
        l.clearcoat_roughness = materials[m].clearcoat_roughness * layer_texel(p, CLEARCOAT_ROUGHNESS_SLOT).g;
        if (has_layer_map(p, CLEARCOAT_NORMAL_SLOT)) {
            let scale = materials[m].clearcoat_normal_scale;
            let texel = layer_texel(p, CLEARCOAT_NORMAL_SLOT);
            let map = normal_of_map(texel, scale);
            l.clearcoat_normal = bend_normal(normal, map, CLEARCOAT_NORMAL_SLOT, triangle, corners, instance);
            l.clearcoat_roughness = widened_roughness(l.clearcoat_roughness, (1.0 - texel.w) * scale);
        }
    }
    if (HAS_SHEEN) {
        l.sheen = materials[m].sheen * layer_texel(p, SHEEN_COLOR_SLOT).rgb;
        l.sheen_roughness = materials[m].sheen_roughness * layer_texel(p, SHEEN_ROUGHNESS_SLOT).a;
    }
    if (HAS_ANISOTROPY && materials[m].anisotropy > 0.0) {
        var direction = materials[m].anisotropy_direction;
        l.anisotropy = materials[m].anisotropy;
        if (has_layer_map(p, ANISOTROPY_SLOT)) {
            let texel = layer_texel(p, ANISOTROPY_SLOT);
            let turn = texel.xy * 2.0 - 1.0;
            direction = vec2f(direction.x * turn.x - direction.y * turn.y, direction.y * turn.x + direction.x * turn.y);
            l.anisotropy *= texel.z;
        }
        l.tangent = bend_normal(normal, vec3f(direction, 0.0), ANISOTROPY_SLOT, triangle, corners, instance);
    }
    if (HAS_TRANSMISSION) {
        l.transmission = materials[m].transmission * layer_texel(p, TRANSMISSION_SLOT).r;
    }
    if (HAS_VOLUMES && materials[m].thickness > 0.0) {
        // The instance scales lengths, on average over directions by the cube root of its volume.
        let w = instances[instance].world_from_local;
        let scale = pow(abs(determinant(mat3x3f(w[0], w[1], w[2]))), 1.0 / 3.0);
        // Rays find the way through a solid, so its texture is not read: it is for renderers that guess the way.
        l.thickness = materials[m].thickness * scale;
        l.attenuation = materials[m].attenuation;
    }
    return l;
}
