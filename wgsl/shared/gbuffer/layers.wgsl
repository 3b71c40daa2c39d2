// The layers of a pixel of the G-buffer, in two words of 16 bytes behind that of its surface.
//
// Shares, roughness, anisotropy and the inverse of the index of refraction have 16 bits: they err by at most 8e-6; the
// tangent is an angle about the normal and errs by 5e-5 radians; the clear coat's normal errs as the surface's; colours
// as the base colour. The absorption of volumes is left out: passes that need it evaluate the surface.
#import "shared/gbuffer/stride.wgsl"
#import "shared/gbuffer/surface.wgsl"

// Returns the angle of a tangent about a normal, over a turn.
fn tangent_turn(normal: vec3f, tangent: vec3f) -> f32 {
    // The frame of the normal as it is read.
    let frame = frame_from_normal(octahedral_decode(unpack2x16snorm(pack2x16snorm(octahedral_encode(normal)))));
    return fract(atan2(dot(tangent, frame[1]), dot(tangent, frame[0])) / TWO_PI);
}

// Steps of the square root of f0 up to 1: it has one at that of 0.04, which errs by rounding only.
const F0_STEPS: f32 = 1020.0;

fn f0_code(f0: vec3f) -> u32 {
    let code = vec3u(round(sqrt(saturate(f0)) * F0_STEPS));
    return code.r | (code.g << 10u) | (code.b << 20u);
}

fn f0_of_code(code: u32) -> vec3f {
    let root = vec3f(vec3u(code, code >> 10u, code >> 20u) & vec3u(1023u)) / F0_STEPS;
    return root * root;
}

// Returns the first word: what reflects beside the base.
fn pack_coats(l: Layers) -> vec4u {
    return vec4u(
        f0_code(l.f0), pack2x16unorm(vec2f(l.clearcoat, l.clearcoat_roughness)),
        pack2x16snorm(octahedral_encode(l.clearcoat_normal)), color_code(l.sheen));
}

// Returns the second word. The angle of 16 bits wraps around.
fn pack_lobes(l: Layers, normal: vec3f) -> vec4u {
    let turn = u32(round(tangent_turn(normal, l.tangent) * 65536.0)) & 0xffffu;
    return vec4u(
        pack2x16unorm(vec2f(1.0 / max(l.ior, 1.0), l.f90)), pack2x16unorm(vec2f(l.sheen_roughness, l.anisotropy)),
        turn | pack2x16unorm(vec2f(0.0, l.transmission)), bitcast<u32>(l.thickness));
}

fn unpack_layers(normal: vec3f, coats: vec4u, lobes: vec4u) -> Layers {
    var l = no_layers();
    if (HAS_SPECULAR) {
        let index = unpack2x16unorm(lobes.x);
        l.f0 = f0_of_code(coats.x);
        l.f90 = index.y;
        l.ior = 1.0 / max(index.x, 1e-2);
    }
    if (HAS_CLEARCOAT) {
        let coat = unpack2x16unorm(coats.y);
        l.clearcoat = coat.x;
        l.clearcoat_roughness = coat.y;
        l.clearcoat_normal = octahedral_decode(unpack2x16snorm(coats.z));
    }
    if (HAS_SHEEN) {
        l.sheen = color_of_code(coats.w);
        l.sheen_roughness = unpack2x16unorm(lobes.y).x;
    }
    if (HAS_ANISOTROPY) {
        let angle = f32(lobes.z & 0xffffu) * (TWO_PI / 65536.0);
        let frame = frame_from_normal(normal);
        l.anisotropy = unpack2x16unorm(lobes.y).y;
        l.tangent = frame[0] * cos(angle) + frame[1] * sin(angle);
    }
    if (HAS_TRANSMISSION) {
        l.transmission = unpack2x16unorm(lobes.z).y;
        l.thickness = bitcast<f32>(lobes.w);
    }
    return l;
}
