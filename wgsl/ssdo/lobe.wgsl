// Directions drawn from the coat of a surface, and the weight of the light that they find: f_r cos / pdf, f_r the
// coat's part of the BRDF. The density is that of `common/brdf.wgsl`, so weights are bounded.
#import "common/lobes.wgsl"
#import "common/random.wgsl"

const LOBE_SEED: u32 = 0x9e3779b9u;  // sets the sequence apart from that of other directions
const CHOICE_SEED: u32 = 0x85ebca6bu;

// GGX alpha from which on directions drawn by the cosine serve the coat, too. Rooms glossy 102 and room 3, one bounce, 24
// frames of 48x27, relMSE: 0.32 and 0.104 with 0.25, 0.36 and 0.102 with 0.5, 0.42 and 0.097 if coats always draw their own.
const WIDE: f32 = 0.25;

// Returns whether directions are drawn from a coat. `others`: there are directions drawn by the cosine.
fn draws_lobe(brdf: Brdf, others: bool) -> bool {
    return brdf.glossy && !(others && lobe_width(brdf) >= WIDE);
}

// Returns pi f_r of a coat, the weight of the light from a direction drawn by the cosine.
fn coat_towards(brdf: Brdf, normal: vec3f, to_eye: vec3f, direction: vec3f) -> vec3f {
    let frame = frame_from_normal(normal);
    return PI * evaluate_brdf(coat_of(brdf), to_eye * frame, direction * frame).rgb;
}

// Draws direction `number` from a coat; `frame`: axes about the shading normal.
fn sample_lobe(brdf: Brdf, frame: mat3x3f, to_eye: vec3f, number: u32, seed: u32) -> vec3f {
    let u = sobol_2d(number, seed ^ LOBE_SEED);
    let choice = sobol_2d(number, seed ^ CHOICE_SEED).x;
    return frame * sample_brdf(coat_of(brdf), to_eye * frame, u, choice).w_i;
}

// Returns the weight of a direction that sample_lobe() drew. It varies slowly, so it may be that of a direction nearby.
fn lobe_weight_of(brdf: Brdf, normal: vec3f, to_eye: vec3f, direction: vec3f) -> vec3f {
    let frame = frame_from_normal(normal);
    let w_i = direction * frame;
    let f = evaluate_brdf(coat_of(brdf), to_eye * frame, w_i);
    return select(vec3f(0.0), f.rgb * (w_i.z / max(f.w, 1e-30)), f.w > 0.0);
}
