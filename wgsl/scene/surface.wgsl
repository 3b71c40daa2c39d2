// The surface at a hit: position, normals, material.
#import "scene/surface_layers.wgsl"
#import "scene/ray_offset.wgsl"
#import "scene/facing_normal.wgsl"

struct Surface {
    position: vec3f,          // metres, relative to the scene's origin
    offset: f32,              // of rays that leave it, metres (`ray_offset.wgsl`)
    geometric_normal: vec3f,  // unit, on the counter-clockwise side
    normal: vec3f,            // unit, shading, facing the viewer (`facing_normal.wgsl`)
    unbent_normal: vec3f,     // unit, shading, on the viewer's side of the triangle
    bumped: bool,             // its normal is of a normal map
    front: bool,              // the viewer is on the counter-clockwise side
    flags: u32,               // of the material; GLASS only where it is smooth
    emission: vec3f,          // W/(m2 sr) towards the viewer
    base_color: vec3f,
    metallic: f32,
    roughness: f32,
    emitter_pdf: f32,         // 1/m2
    layers: Layers,
}

// Evaluates the surface at the hit of a ray in `direction`, textures at a point.
fn surface_at(hit: Hit, direction: vec3f) -> Surface {
    return surface_on(load_triangle(hit.triangle), hit, direction);
}

// Evaluates the surface at a hit of a triangle that is already loaded, textures at a point.
fn surface_on(triangle: Triangle, hit: Hit, direction: vec3f) -> Surface {
    return surface_over(triangle, hit, direction, no_footprint());
}

// Evaluates the surface at the hit of a ray that is `width` wide there, metres; `direction`: unit.
fn surface_of_cone(hit: Hit, direction: vec3f, width: f32) -> Surface {
    let triangle = load_triangle(hit.triangle);
    var footprint = no_footprint();
    if (HAS_TEXTURES) {
        footprint = ray_footprint(triangle, hit, direction, width);
    }
    return surface_over(triangle, hit, direction, footprint);
}

// Evaluates the surface at a hit, textures over a footprint.
fn surface_over(triangle: Triangle, hit: Hit, direction: vec3f, footprint: HitFootprint) -> Surface {
    // Interpolate position and normal.
    let weights = hit_weights(triangle, hit);
    var position = hit_point(triangle, hit);
    // Scaling keeps the cross product of tiny or huge edges in range.
    let size = max(max3(abs(triangle.edge1)), max3(abs(triangle.edge2)));
    var geometric = cross(triangle.edge1 / size, triangle.edge2 / size);
    var terms = hit_terms(triangle, hit);
    var corners: Corners;
    var s: Surface;
    // Load single fields: a whole material has 64 words.
    let material = triangle.material;
    s.flags = materials[material].flags;
    let textured = HAS_TEXTURES && (s.flags & TEXTURED) != 0u;
    let layered = HAS_LAYERS && (s.flags & LAYERED) != 0u;
    let has_tangent = HAS_ANISOTROPY && layered && materials[material].anisotropy > 0.0;
    if ((triangle.flags & (SMOOTH | COLORED)) != 0u || textured || has_tangent) {
        corners = load_corners(triangle, weights);
    }
    var normal = geometric;
    let smooth_normal = (triangle.flags & SMOOTH) != 0u;
    if (smooth_normal) {
        normal = weights.x * unpack_normal(corners.b.normal) + weights.y * unpack_normal(corners.c.normal)
            + corners.weights.x * unpack_normal(corners.a.normal);
    }
    // Vertex normals are local; positions and edges are local only where the mesh is entered through an instance.
    let is_local = HAS_INSTANCES && triangle.instance == NONE;
    if (is_local || smooth_normal) {
        let m = instances[hit.instance].local_from_world;
        let normal_matrix = transpose(mat3x3f(m[0], m[1], m[2]));
        if (smooth_normal) {
            normal = normal_matrix * normal;
        }
        if (is_local) {
            geometric = normal_matrix * geometric;
            if (!smooth_normal) {
                normal = geometric;
            }
            let w = instances[hit.instance].world_from_local;
            position = w * vec4f(position, 1.0);
            terms = transformed_terms(w, max(terms, abs(hit_point(triangle, hit))));
        }
    }
    s.position = position;
    s.geometric_normal = normalize_or(geometric, -direction);
    s.offset = ray_offset(s.geometric_normal, terms);
    s.normal = normalize_or(normal, s.geometric_normal);
    s.front = dot(s.geometric_normal, direction) < 0.0;
    // Vertex normals may lie on the other side of the triangle.
    let inverted = dot(s.normal, s.geometric_normal) < 0.0;

    s.layers = no_layers();
    if (layered) {
        s.layers = material_layers(triangle, corners, hit.instance, s.normal, textured, footprint);
    }

    // Evaluate the material.
    var base = materials[material].base_color;
    s.metallic = materials[material].metallic;
    s.roughness = materials[material].roughness;
    s.emission = materials[material].emission;
    s.emitter_pdf = materials[material].emitter_pdf;
    if (HAS_VERTEX_COLORS && (triangle.flags & COLORED) != 0u) {
        base *= color_at(corners);
    }
    if (textured) {
        let uv0 = texcoord0_at(corners);
        let uv1 = texcoord1_at(corners);
        let covered = uv_footprint(corners, footprint);
        let is_point = footprint.is_point;
        if (has_texture(material, BASE_COLOR_SLOT)) {
            base *= read_texture(material, BASE_COLOR_SLOT, uv0, uv1, covered, is_point);
        }
        if (HAS_EMISSION_MAPS && has_texture(material, EMISSION_SLOT)) {
            s.emission *= read_texture(
                material, EMISSION_SLOT, uv0, uv1, covered, is_point || footprint.point_emission).rgb;
            s.emitter_pdf = textured_pdf(material, s.emission);
        }
        if (HAS_ROUGHNESS_MAPS && has_texture(material, METALLIC_ROUGHNESS_SLOT)) {
            let texel = read_texture(material, METALLIC_ROUGHNESS_SLOT, uv0, uv1, covered, is_point);
            s.metallic *= texel.b;
            s.roughness *= texel.g;
        }
        if (HAS_NORMAL_MAPS && has_texture(material, NORMAL_SLOT)) {
            let texel = read_texture(material, NORMAL_SLOT, uv0, uv1, covered, is_point);
            let map = normal_of_map(texel, materials[material].normal_scale);
            s.normal = bend_normal(s.normal, map, NORMAL_SLOT, triangle, corners, hit.instance);
            s.bumped = true;
            // `upload/mip_levels.py`: the standard deviation of the slopes.
            s.roughness = widened_roughness(s.roughness, (1.0 - texel.w) * materials[material].normal_scale);
        }
    }
    if (HAS_TINTS && (s.flags & GLASS) != 0u
        && !is_smooth_at(material, texcoord0_at(corners), texcoord1_at(corners))) {
        s.flags &= ~GLASS;
    }
    s.base_color = base.rgb;
    if (!s.front && (s.flags & DOUBLE_SIDED) == 0u) {
        s.emission = vec3f(0.0);
    }
    // All surfaces reflect on both sides: turn the shading normal to the viewer.
    s.unbent_normal = select(s.normal, -s.normal, s.front == inverted);
    let side = select(-s.geometric_normal, s.geometric_normal, s.front);
    s.normal = facing_normal(s.unbent_normal, side, -direction, s.bumped);
    if (HAS_CLEARCOAT && layered) {
        let coat = select(s.layers.clearcoat_normal, -s.layers.clearcoat_normal, s.front == inverted);
        s.layers.clearcoat_normal = facing_normal(coat, side, -direction, has_texture(material, CLEARCOAT_NORMAL_SLOT));
    }
    return s;
}

// Returns whether rays pass the surface straight on (`see_through.wgsl`).
fn is_clear_glass(s: Surface) -> bool {
    return HAS_TINTS && (s.flags & GLASS) != 0u;
}

// Returns whether the surface has a transmitted lobe.
fn transmits(s: Surface) -> bool {
    return HAS_TRANSMISSION && (s.flags & LAYERED) != 0u && !is_clear_glass(s)
        && s.layers.transmission * (1.0 - s.metallic) * max3(s.base_color) > 0.0;
}

fn surface_brdf(s: Surface) -> Brdf {
    if (HAS_LAYERS && (s.flags & LAYERED) != 0u) {
        var layered = brdf_of(s.base_color, s.metallic, s.roughness, s.layers, s.normal, s.front);
        if (is_clear_glass(s)) {
            layered.transmitted = vec3f(0.0);
        }
        return layered;
    }
    if (HAS_COATS && (s.flags & COATED) != 0u) {
        return brdf_metallic_roughness(s.base_color, s.metallic, s.roughness);
    }
    return brdf_lambert(s.base_color);
}

// Returns the origin of a ray that leaves the surface in `direction`.
fn leave_surface(s: Surface, direction: vec3f) -> vec3f {
    return offset_origin(s.position, s.geometric_normal, s.offset, direction);
}
