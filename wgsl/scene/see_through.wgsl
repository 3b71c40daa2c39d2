// What passes straight through a see-through surface: a blended one, or thin smooth glass.
//
// A share a of it, its alpha, is a surface that itself passes t (0 without glass): P = 1 - a + a t of the light passes, by
// colour. Rays that need one way pass with the probability p = 1 - a q, q = 1 - max t, and then carry P / p; rays that do
// not pass find the surface, with the weight a / (1 - p) = 1 / q (stochastic transparency: Enderton et al. 2010). Without
// glass all weights are 1. Shadow rays need no choice: they carry the product of P. Exact in the mean.
//
// With PASSES_GLASS, shadow rays also pass rough and solid glass, straight on: P of each wall, and exp(-sigma d) of each
// solid. Errs by the light that refraction sends elsewhere (caustics).
#import "common/clearcoat.wgsl"
#import "common/interface.wgsl"
#import "common/layers.wgsl"
#import "common/random.wgsl"
#import "common/sheen.wgsl"
#import "scene/ray_triangle.wgsl"
#import "scene/corners.wgsl"

// Least q: bounds the weight of light that clean glass reflects. Smaller values make what lies behind less noisy, and
// bright reflections noisier.
const LEAST_KEPT: f32 = 0.1;

struct Passage {
    tint: vec3f,    // P
    chance: f32,    // p
    passed: vec3f,  // P / p: factor on the light of rays that pass
    kept: f32,      // a / (1 - p): factor on the light of rays that do not
}

// Returns the passage of a surface of an alpha whose cover passes `glass`.
fn passage_of(alpha: f32, glass: vec3f) -> Passage {
    let a = saturate(alpha);
    if (!HAS_TINTS && !PASSES_GLASS) {
        return Passage(vec3f(1.0 - a), 1.0 - a, vec3f(1.0), 1.0);
    }
    let q = max(1.0 - max3(glass), LEAST_KEPT);
    let chance = 1.0 - a * q;
    let tint = 1.0 - a + a * glass;
    return Passage(tint, chance, tint / max(chance, 1e-6), 1.0 / q);
}

fn is_see_through(material: u32) -> bool {
    return HAS_SEE_THROUGH && (materials[material].flags & SEE_THROUGH) != 0u;
}

// Returns whether shadow rays ask a material how much light passes.
fn passes_shadow_rays(material: u32) -> bool {
    return is_see_through(material) || (PASSES_GLASS && (materials[material].flags & TRANSMITTING) != 0u);
}

// Returns whether parts of a see-through material may be glass.
fn is_glass(material: u32) -> bool {
    return HAS_TINTS && (materials[material].flags & GLASS) != 0u;
}

// A point of a see-through surface.
struct CoverPoint {
    material: u32,
    color: vec4f,            // of the vertices
    uv0: vec2f,
    uv1: vec2f,
    footprint: UvFootprint,
    is_point: bool,          // textures are read at the point
    any_glass: bool,         // rough and solid glass passes light, too
}

// Returns the share of a point that is surface: its alpha if it blends, 0 where a mask cuts it out.
fn cover(material: u32, alpha: f32) -> f32 {
    if (HAS_BLENDS && (materials[material].flags & BLENDED) != 0u) {
        return saturate(alpha);
    }
    return select(1.0, 0.0, alpha < materials[material].alpha_cutoff);
}

// Returns the passage of a point; `cosine`: between the ray and the normal.
fn passage_at(c: CoverPoint, cosine: f32) -> Passage {
    var base = materials[c.material].base_color * c.color;
    if (HAS_TEXTURES && has_texture(c.material, BASE_COLOR_SLOT)) {
        base *= read_texture(c.material, BASE_COLOR_SLOT, c.uv0, c.uv1, c.footprint, c.is_point);
    }
    var glass = vec3f(0.0);
    if (is_glass(c.material) || (c.any_glass && (materials[c.material].flags & TRANSMITTING) != 0u)) {
        glass = glass_at(c, base.rgb, cosine);
    }
    return passage_of(cover(c.material, base.a), glass);
}

// Returns a texture's value at a point, 1 without texture.
fn cover_texel(c: CoverPoint, slot: u32) -> vec4f {
    if (HAS_TEXTURES && has_texture(c.material, slot)) {
        return read_texture(c.material, slot, c.uv0, c.uv1, c.footprint, c.is_point);
    }
    return vec4f(1.0);
}

// Returns the share of light that the layers above a surface let through, once.
fn layers_pass_at(c: CoverPoint, cosine: f32) -> f32 {
    var passes = 1.0;
    if (HAS_CLEARCOAT && materials[c.material].clearcoat > 0.0) {
        let share = materials[c.material].clearcoat * cover_texel(c, CLEARCOAT_SLOT).r;
        let roughness = materials[c.material].clearcoat_roughness * cover_texel(c, CLEARCOAT_ROUGHNESS_SLOT).g;
        passes = clearcoat_passes(clearcoat_of(share, roughness, vec3f(0.0, 0.0, 1.0)), vec3f(0.0, 0.0, cosine));
    }
    if (HAS_SHEEN) {
        let color = materials[c.material].sheen * cover_texel(c, SHEEN_COLOR_SLOT).rgb;
        let mapped = materials[c.material].sheen_roughness * cover_texel(c, SHEEN_ROUGHNESS_SLOT).a;
        let roughness = clamp(mapped, MIN_SHEEN_ROUGHNESS, 1.0);
        passes *= sheen_passes(color, roughness * roughness, cosine);
    }
    return passes;
}

// Returns what a surface passes as a thin wall, t; 0 if it is rough, unless any glass passes.
fn glass_at(c: CoverPoint, color: vec3f, cosine: f32) -> vec3f {
    let mapped = cover_texel(c, METALLIC_ROUGHNESS_SLOT);
    if (!c.any_glass && !is_smooth_at(c.material, c.uv0, c.uv1)) {
        return vec3f(0.0);
    }
    var f0 = vec3f(0.04);
    var f90 = 1.0;
    if (HAS_SPECULAR) {
        f90 = materials[c.material].specular * cover_texel(c, SPECULAR_SLOT).a;
        let tint = materials[c.material].specular_color * cover_texel(c, SPECULAR_COLOR_SLOT).rgb;
        f0 = min(materials[c.material].dielectric_f0 * tint, vec3f(1.0)) * f90;
    }
    let dielectric = 1.0 - materials[c.material].metallic * mapped.b;
    let transmission = materials[c.material].transmission * cover_texel(c, TRANSMISSION_SLOT).r * dielectric;
    var passed = thin_transmittance(color, f0, f90, transmission, cosine);
    return passed * layers_pass_at(c, cosine);
}

// Returns the passage of a point of a triangle, textures read at the point.
fn passage_of_weights(t: Triangle, weights: vec2f, cosine: f32, any_glass: bool) -> Passage {
    let k = load_corners(t, weights);
    let c = CoverPoint(
        t.material, color_at(k), texcoord0_at(k), texcoord1_at(k), UvFootprint(vec4f(0.0), vec4f(0.0), 1.0), true,
        any_glass);
    return passage_at(c, cosine);
}

// Returns the cosine between a ray and the normal of the triangle that it hits, above 0 on the clockwise side.
fn cosine_of_hit(t: Triangle, hit: Hit, direction: vec3f) -> f32 {
    var normal = cross(t.edge1, t.edge2);
    if (HAS_INSTANCES && t.instance == NONE) {
        let m = instances[hit.instance].local_from_world;
        normal = transpose(mat3x3f(m[0], m[1], m[2])) * normal;
    }
    return dot(normalize_or(normal, vec3f(0.0)), normalize_or(direction, vec3f(0.0)));
}

// Returns whether a hit lies on an edge: both of its triangles are hit (`ray_triangle.wgsl`), each takes half of the surface.
fn is_on_edge(weights: vec2f) -> bool {
    return min(min(weights.x, weights.y), 1.0 - weights.x - weights.y) < EDGE;
}

// Returns the absorption of a solid up to a hit of its surface, as the logarithm of a factor: below 0 where a ray leaves
// it, and as much above 0 where it enters.
fn absorbed_until(t: Triangle, hit: Hit, direction: vec3f) -> vec3f {
    if (!PASSES_GLASS || !HAS_VOLUMES || materials[t.material].thickness <= 0.0) {
        return vec3f(0.0);
    }
    let share = select(1.0, 0.5, is_on_edge(hit_weights(t, hit)));
    let way = materials[t.material].attenuation * (share * hit.distance * length(direction));
    return select(way, -way, cosine_of_hit(t, hit, direction) > 0.0);
}

// Returns the passage at a hit; `direction`: of the ray in the world.
fn passage_of_hit(t: Triangle, hit: Hit, direction: vec3f, any_glass: bool) -> Passage {
    let weights = hit_weights(t, hit);
    var cosine = 1.0;
    if (HAS_TINTS || any_glass) {
        cosine = abs(cosine_of_hit(t, hit, direction));
    }
    let p = passage_of_weights(t, weights, cosine, any_glass);
    if (is_on_edge(weights)) {
        return Passage(sqrt(p.tint), sqrt(p.chance), sqrt(p.passed), p.kept);
    }
    return p;
}

// Returns the share of a point of a triangle that is surface: its alpha if it blends, 0 where a mask cuts it out,
// 1 of glass.
fn coverage_at(t: Triangle, weights: vec2f) -> f32 {
    if ((t.flags & MASKED) == 0u) {
        return 1.0;
    }
    let k = load_corners(t, weights);
    let alpha = base_alpha(
        t.material, color_at(k).a, texcoord0_at(k), texcoord1_at(k), UvFootprint(vec4f(0.0), vec4f(0.0), 1.0), true);
    return cover(t.material, alpha);
}
