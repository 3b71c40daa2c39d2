// Points on the scene's surfaces, in proportion to area.
#import "common/math.wgsl"

struct SurfacePoint {
    position: vec3f,  // metres relative to the scene's origin
    normal: vec3f,    // unit, geometric, on the counter-clockwise side
    radius: f32,      // of a disc with the area that the point represents, metres
    albedo: vec3f,    // hemispherical reflectance, 8 bits
    triangle: u32,
    instance: u32,
    open: bool,       // on a see-through surface, where light passes: there is no surface
}

// Two words each. The points are a low-discrepancy sequence: every prefix is spread evenly over the area.
@group(1) @binding(44) var<storage, read> points: array<vec4u>;

fn point_count() -> u32 {
    return arrayLength(&points) / 2u;
}

fn load_point(index: u32) -> SurfacePoint {
    let a = points[2u * index];
    let b = points[2u * index + 1u];
    let surface = unpack4x8unorm(b.y);
    return SurfacePoint(
        bitcast<vec3f>(a.xyz), octahedral_decode(unpack2x16snorm(a.w)), bitcast<f32>(b.x), surface.rgb, b.z, b.w,
        surface.a <= 0.0);
}
