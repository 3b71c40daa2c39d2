// The BRDF of a material with layers, on one side of a surface.
#import "common/base.wgsl"
#import "common/sheen.wgsl"

// Returns whether light that passes the surface is refracted into a volume.
fn has_volume(layers: Layers) -> bool {
    return HAS_VOLUMES && layers.thickness > 0.0 && layers.transmission > 0.0;
}

// Returns the BRDF of a material seen from one side. `normal`: shading, unit, world space, facing the viewer; `outside`:
// the viewer is on the counter-clockwise side, outside a solid.
fn brdf_of(
    base_color: vec3f, metallic: f32, roughness: f32, layers: Layers, normal: vec3f, outside: bool
) -> Brdf {
    let across = max(roughness * roughness, MIN_ALPHA);
    let anisotropy = select(0.0, layers.anisotropy, HAS_ANISOTROPY);
    let along = mix(across, 1.0, anisotropy * anisotropy);
    var b = brdf_metallic_alpha(base_color, metallic, select(across, sqrt(along * across), HAS_ANISOTROPY));
    let frame = frame_from_normal(normal);
    let solid = has_volume(layers);
    let has_interface = abs(layers.ior - 1.0) > LEAST_CONTRAST;
    if (HAS_SPECULAR) {
        // Equal media have no interface; an opaque dielectric keeps the grazing reflection that Khronos gives it.
        let seen = select(1.0, 0.0, solid && !has_interface);
        b.f0 = mix(layers.f0 * seen, base_color, metallic);
        b.f90 = mix(layers.f90 * seen, 1.0, metallic);
        b.fit = fit_of_dielectric(b.fit, max3(layers.f0) * seen, layers.f90 * seen);
    }
    if (HAS_ANISOTROPY && anisotropy > 0.0) {
        b.stretch = sqrt(along / across);
        b.stretched_fit = fit_anisotropic(vec2f(along, across), b.fit.f0, b.fit.f90);
        b.multiple = multiple_albedo(base_color, metallic, b.stretched_fit.mean_missing);
        let tangent = (layers.tangent * frame).xy;
        b.tangent = normalize_or(vec3f(tangent, 0.0), vec3f(1.0, 0.0, 0.0)).xy;
    }
    if (HAS_CLEARCOAT && layers.clearcoat > 0.0) {
        b.clearcoat = clearcoat_of(layers.clearcoat, layers.clearcoat_roughness, layers.clearcoat_normal * frame);
    }
    if (HAS_SHEEN) {
        b.sheen = layers.sheen;
        let sheen_roughness = clamp(layers.sheen_roughness, MIN_SHEEN_ROUGHNESS, 1.0);
        b.sheen_alpha = sheen_roughness * sheen_roughness;
    }
    if (HAS_TRANSMISSION) {
        b.transmitted = base_color * (layers.transmission * (1.0 - metallic));
        b.diffuse *= 1.0 - layers.transmission;
        if (solid && has_interface) {
            b.eta = select(1.0 / layers.ior, layers.ior, outside);
            // Light inside a solid does not meet the matte share of its surface.
            b.diffuse *= select(0.0, 1.0, outside);
        }
        // Khronos' viewer: a wall whose media hardly differ spreads light less.
        let spread = saturate(2.0 * layers.ior - 2.0);
        b.transmitted_alpha = max(b.alpha * spread, MIN_ALPHA * b.stretch);
        b.transmitted_fit = fit_of_dielectric(fit_coat(b.transmitted_alpha), b.fit.f0, b.fit.f90);
    }
    return b;
}

// Returns a BRDF in another frame; `behind`: that of a viewer on the other side, for what passes to this one.
fn turned_brdf(b: Brdf, from_frame: mat3x3f, to_frame: mat3x3f, behind: bool) -> Brdf {
    var turned = b;
    let tangent = from_frame * vec3f(b.tangent, 0.0) * to_frame;
    turned.tangent = normalize_or(vec3f(tangent.xy, 0.0), vec3f(1.0, 0.0, 0.0)).xy;
    let normal = from_frame * b.clearcoat.normal * to_frame;
    turned.clearcoat.normal = select(normal, -normal, behind);
    turned.eta = select(b.eta, 1.0 / b.eta, behind && b.eta > 0.0);
    return turned;
}
