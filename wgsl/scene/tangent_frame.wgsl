// The frame of normal maps on a triangle, and what they do to normals and to roughness.
#import "scene/footprint.wgsl"

fn unpack_normal(code: u32) -> vec3f {
    return octahedral_decode(unpack2x16snorm(code));
}

// Returns the vector of a normal map's texel, its slopes scaled.
fn normal_of_map(texel: vec4f, scale: f32) -> vec3f {
    return (texel.xyz * 2.0 - 1.0) * vec3f(scale, scale, 1.0);
}

// Returns the unit direction of a vector in the frame of a normal map, such as the normal that the map bends. The tangent
// is the direction of the picture's u: derived from the texture coordinates, or that of the file, turned as the slot's
// transform turns the texture. Khronos' viewer derives it from transformed coordinates, too.
fn bend_normal(normal: vec3f, map: vec3f, slot: u32, triangle: Triangle, k: Corners, instance: u32) -> vec3f {
    let world_from_local = instances[instance].world_from_local;
    let material = triangle.material;
    // The linear part of the texture's transform.
    let row_u = materials[material].textures[slot].transform_u.xy;
    let row_v = materials[material].textures[slot].transform_v.xy;
    var tangent: vec3f;
    var handedness = 1.0;
    var tilt = map.xy;
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
        let second = (materials[material].textures[slot].flags & TEXCOORD_1) != 0u;
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
