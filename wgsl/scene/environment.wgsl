// The environment's radiance by direction: a constant, or a latitude-longitude map times a factor.
#import "scene/info.wgsl"
#import "common/math.wgsl"

@group(1) @binding(9) var environment: texture_2d<f32>;

override HAS_ENVIRONMENT: bool = true;
override HAS_PICTURED_ENVIRONMENT: bool = true;

fn environment_uv(direction: vec3f) -> vec2f {
    let u = atan2(direction.x, -direction.z) / TWO_PI + scene.environment_rotation;
    // atan2, because acos may be off by 1e-4 in drivers.
    let v = atan2(length(direction.xz), direction.y) * INV_PI;
    return vec2f(u - floor(u), v);
}

// Returns the map's value at `point`, in pixels from its top left corner; bilinear between pixel centres.
fn picture_at(point: vec2f) -> vec3f {
    let size = vec2i(textureDimensions(environment));
    let base = vec2i(floor(point - 0.5));
    let f = point - 0.5 - vec2f(base);
    let x0 = select(base.x, size.x - 1, base.x < 0);
    let x1 = select(base.x + 1, 0, base.x + 1 >= size.x);
    let y0 = clamp(base.y, 0, size.y - 1);
    let y1 = clamp(base.y + 1, 0, size.y - 1);
    let top = mix(textureLoad(environment, vec2i(x0, y0), 0), textureLoad(environment, vec2i(x1, y0), 0), f.x);
    let bottom = mix(textureLoad(environment, vec2i(x0, y1), 0), textureLoad(environment, vec2i(x1, y1), 0), f.x);
    return mix(top, bottom, f.y).rgb;
}

// Returns the environment's radiance seen in `direction`, W/(m2 sr).
fn environment_radiance(direction: vec3f) -> vec3f {
    if (!HAS_PICTURED_ENVIRONMENT) {
        return scene.environment_color;
    }
    return scene.environment_color * picture_at(environment_uv(direction) * vec2f(textureDimensions(environment)));
}
