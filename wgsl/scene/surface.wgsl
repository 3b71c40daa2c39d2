// The surface at a hit: position, normals, material.
#import "common/layers.wgsl"
#import "scene/footprint.wgsl"
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
    flags: u32,               // of the material
    emission: vec3f,          // W/(m2 sr) towards the viewer
    base_color: vec3f,
    metallic: f32,
    roughness: f32,
    emitter_pdf: f32,         // 1/m2
    layers: Layers,
}

fn unpack_normal(code: u32) -> vec3f {
    return octahedral_decode(unpack2x16snorm(code));
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
    if ((triangle.flags & (SMOOTH | COLORED)) != 0u || textured) {
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
            s.normal = bend_normal(s.normal, texel.xyz * 2.0 - 1.0, triangle, corners, hit.instance);
            s.bumped = true;
            // `upload/mip_levels.py`: the standard deviation of the slopes.
            s.roughness = widened_roughness(s.roughness, (1.0 - texel.w) * materials[material].normal_scale);
        }
    }
    s.base_color = base.rgb;
    if (!s.front && (s.flags & DOUBLE_SIDED) == 0u) {
        s.emission = vec3f(0.0);
    }
    // All surfaces reflect on both sides: turn the shading normal to the viewer.
    s.unbent_normal = select(s.normal, -s.normal, s.front == inverted);
    let side = select(-s.geometric_normal, s.geometric_normal, s.front);
    s.normal = facing_normal(s.unbent_normal, side, -direction, s.bumped);
    s.layers = no_layers();
    return s;
}

// Returns the normal bent by a normal map's vector. The tangent is the direction of the picture's u: derived from the
// texture coordinates, or that of the file, turned as the slot's transform turns the texture. Khronos' viewer derives it
// from transformed coordinates, too.
fn bend_normal(normal: vec3f, map: vec3f, triangle: Triangle, k: Corners, instance: u32) -> vec3f {
    let world_from_local = instances[instance].world_from_local;
    let material = triangle.material;
    // The linear part of the texture's transform.
    let row_u = materials[material].textures[NORMAL_SLOT].transform_u.xy;
    let row_v = materials[material].textures[NORMAL_SLOT].transform_v.xy;
    var tangent: vec3f;
    var handedness = 1.0;
    var tilt = map.xy * materials[material].normal_scale;
    if ((triangle.flags & HAS_TANGENTS) != 0u) {
        let local = k.weights.x * unpack_normal(k.a.tangent) + k.weights.y * unpack_normal(k.b.tangent)
            + k.weights.z * unpack_normal(k.c.tangent);
        tangent = world_from_local * vec4f(local, 0.0);
        handedness = select(1.0, -1.0, (k.a.tangent & 1u) != 0u);
        // The file's frame is (dP/du, -dP/dv); the transformed dP/du is the first column of the inverse transform in it.
        let mirror = select(1.0, -1.0, row_u.x * row_v.y - row_u.y * row_v.x < 0.0);
        let turn = normalize_or(vec3f(row_v.y, row_v.x, 0.0) * mirror, vec3f(1.0, 0.0, 0.0)).xy;
        tilt = turn * tilt.x + vec2f(-turn.y, turn.x) * (mirror * tilt.y);
    } else {
        let second = (materials[material].textures[NORMAL_SLOT].flags & TEXCOORD_1) != 0u;
        let a = select(k.a.texcoord0, k.a.texcoord1, second);
        let b = select(k.b.texcoord0, k.b.texcoord1, second) - a;
        let c = select(k.c.texcoord0, k.c.texcoord1, second) - a;
        let d1 = vec2f(dot(row_u, b), dot(row_v, b));
        let d2 = vec2f(dot(row_u, c), dot(row_v, c));
        let area = d1.x * d2.y - d1.y * d2.x;
        tangent = (triangle.edge1 * d2.y - triangle.edge2 * d1.y) * sign(area);
        if (triangle.instance == NONE) {
            tangent = world_from_local * vec4f(tangent, 0.0);
        }
        // glTF's v points down in the picture, its bitangent up: area < 0 is the usual, unmirrored case.
        handedness = select(1.0, -1.0, area > 0.0);
    }
    // The bitangent is defined in mesh space (glTF 2.0, section 3.7.2.1); a mirroring transform flips a cross product.
    // Triangles in the world's tree already have swapped corners, so their derived tangents need no flip.
    let mirrored = determinant(mat3x3f(world_from_local[0], world_from_local[1], world_from_local[2])) < 0.0;
    if (mirrored && ((triangle.flags & HAS_TANGENTS) != 0u || triangle.instance == NONE)) {
        handedness = -handedness;
    }
    let t = normalize_or(tangent - normal * dot(normal, tangent), frame_from_normal(normal)[0]);
    let b = cross(normal, t) * handedness;
    return normalize_or(t * tilt.x + b * tilt.y + normal * map.z, normal);
}

// Returns the roughness of a lobe that is spread by slopes of standard deviation `sigma` per axis: alpha^2 grows by
// 2 sigma^2 (Olano and Baker 2010, "LEAN Mapping", section 3), which is exact for Beckmann's distribution.
fn widened_roughness(roughness: f32, sigma: f32) -> f32 {
    let alpha = roughness * roughness;
    return select(roughness, sqrt(sqrt(min(alpha * alpha + 2.0 * sigma * sigma, 1.0))), sigma != 0.0);
}

fn surface_brdf(s: Surface) -> Brdf {
    if (HAS_COATS && (s.flags & COATED) != 0u) {
        return brdf_metallic_roughness(s.base_color, s.metallic, s.roughness);
    }
    return brdf_lambert(s.base_color);
}

// Returns the origin of a ray that leaves the surface in `direction`.
fn leave_surface(s: Surface, direction: vec3f) -> vec3f {
    return offset_origin(s.position, s.geometric_normal, s.offset, direction);
}
