// Footprints of pixels and rays on a triangle: the texture level is that of what they cover.
//
// A footprint is the parallelogram of two derivatives of the hit (Igehy 1999, "Tracing Ray Differentials"): by the
// steps to the next pixels, or by the width of a ray's cone in the plane of incidence and across it (Akenine-Moeller et
// al. 2021, "Improved Shader and Texture Level of Detail Using Ray Cones"). It is linear: exact but for perspective
// within the footprint.
#import "scene/corners.wgsl"

// Sides as changes of the barycentric weights of the second and third corner. The flags are constants, so that the code
// for one kind is compiled out.
struct HitFootprint {
    x: vec2f,
    y: vec2f,
    anisotropy: f32,      // most samples along the longer axis
    is_point: bool,       // textures are read at a point of their finest level
    point_emission: bool, // emission maps are, as light samples read them
}

fn no_footprint() -> HitFootprint {
    return HitFootprint(vec2f(0.0), vec2f(0.0), 1.0, true, true);
}

// Returns how the weights at a hit change when the ray's origin and direction change, all in the triangle's space.
fn weight_change(
    t: Triangle, at: vec2f, origin: vec3f, direction: vec3f, by_origin: vec3f, by_direction: vec3f
) -> vec2f {
    // The derivative of the quotients of `hit_plane`.
    let s = origin - t.anchor;
    let p = cross(direction, t.edge2);
    let turned = cross(by_direction, t.edge2);
    let determinant = dot(t.edge1, p);
    let weights = vec2f(
        dot(by_origin, p) + dot(s, turned),
        dot(direction, cross(by_origin, t.edge1)) + dot(by_direction, cross(s, t.edge1)));
    let change = (weights - at * dot(t.edge1, turned)) / select(1.0, determinant, abs(determinant) >= SMALLEST_NORMAL);
    // Seen edge-on it is infinite: the texture's mean.
    return clamp(change, vec2f(-FLOAT_MAX * 1e-20), vec2f(FLOAT_MAX * 1e-20));
}

// Returns the footprint of a ray that is `width` wide where it hits, metres; `direction`: unit.
fn ray_footprint(t: Triangle, hit: Hit, direction: vec3f, width: f32) -> HitFootprint {
    let is_local = HAS_INSTANCES && t.instance == NONE;
    let scale = max(max3(abs(t.edge1)), max3(abs(t.edge2)));
    var normal = cross(t.edge1 / scale, t.edge2 / scale);
    if (is_local) {
        let m = instances[hit.instance].local_from_world;
        normal = transpose(mat3x3f(m[0], m[1], m[2])) * normal;
    }
    var across = normalize_or(cross(direction, normal), frame_from_normal(direction)[0]) * width;
    var along = cross(direction, across);
    var local_direction = direction;
    if (is_local) {
        let m = instances[hit.instance].local_from_world;
        across = m * vec4f(across, 0.0);
        along = m * vec4f(along, 0.0);
        local_direction = m * vec4f(direction, 0.0);
    }
    // The origin does not matter for parallel rays.
    return HitFootprint(
        weight_change(t, hit.from_anchor, t.anchor, local_direction, across, vec3f(0.0)),
        weight_change(t, hit.from_anchor, t.anchor, local_direction, along, vec3f(0.0)), 1.0, false, true);
}

// Returns the footprint of a pixel on the triangle that it shows; `ray`: through the pixel.
fn pixel_footprint(ray: Ray, t: Triangle, hit: Hit) -> HitFootprint {
    if (!HAS_TEXTURES) {
        return no_footprint();
    }
    // The steps to the next pixels: of parallel rays they move the origin, of others the end of the direction.
    let steps = mat2x3f(view.right * (2.0 / f32(view.whole.x)), view.up * (2.0 / f32(view.whole.y))) * view.footprint;
    let parallel = view.orthographic != 0u;
    let by_origin = select(0.0, 1.0, parallel) * steps;
    let by_direction = select(dot(ray.direction, view.forward), 0.0, parallel) * steps;
    var m = mat4x3f(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0);
    if (HAS_INSTANCES && t.instance == NONE) {
        m = instances[hit.instance].local_from_world;
    }
    let linear = mat3x3f(m[0], m[1], m[2]);
    let origin = m * vec4f(ray.origin, 1.0);
    let direction = linear * ray.direction;
    return HitFootprint(
        weight_change(t, hit.from_anchor, origin, direction, linear * by_origin[0], linear * by_direction[0]),
        weight_change(t, hit.from_anchor, origin, direction, linear * by_origin[1], linear * by_direction[1]),
        view.anisotropy, false, false);
}

// Returns a footprint in texture coordinates.
fn uv_footprint(k: Corners, f: HitFootprint) -> UvFootprint {
    let a = vec4f(k.a.texcoord0, k.a.texcoord1);
    let b = vec4f(k.b.texcoord0, k.b.texcoord1) - a;
    let c = vec4f(k.c.texcoord0, k.c.texcoord1) - a;
    return UvFootprint(f.x.x * b + f.x.y * c, f.y.x * b + f.y.y * c, f.anisotropy);
}
