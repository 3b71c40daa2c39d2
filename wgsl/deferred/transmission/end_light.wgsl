// The light that a surface point at the end of a path sends back along it, W/(m2 sr).
//
// Where the picture shows the point and it is matte, its light is that of its pixel. Elsewhere L = L_d + f_r cos /
// density L(y): a sample of the lights (`deferred/hit_light.wgsl`) and a ray that follows the BRDF to y, whose light is
// found the same way. Errs dark after BOUNCES such rays, and as the technique does where the picture shows a point.
#import "shared/gbuffer/in_picture.wgsl"
#import "deferred/transmission/walk.wgsl"
#import "common/matte.wgsl"

override BOUNCES: u32 = 3u;          // most on the way from a path's end to a point that the picture shows
override HAS_INDIRECT: bool = true;  // the technique has indirect light

// Pairs of random numbers of each point: those of `reflected_radiance`, the direction, the part of the lobe.
const PAIRS_PER_BOUNCE: u32 = 8u;

@group(1) @binding(11) var<storage, read> direct: array<vec4f>;
@group(1) @binding(12) var<storage, read> indirect: array<vec4f>;

// Returns direct and indirect light of the pixel onto which a point falls.
fn picture_light(position: vec3f) -> vec3f {
    let pixel = pixel_in_picture(position);
    let index = pixel.y * view.size.x + pixel.x;
    if (HAS_INDIRECT) {
        return direct[index].rgb + indirect[index].rgb;
    }
    return direct[index].rgb;
}

// Returns whether the picture shows a point and the light that it sends along the path.
fn is_shown(p: PathPoint) -> bool {
    return is_matte_brdf(p.brdf) && is_in_picture(p.surface.position, p.side);
}

// Returns the light of a path's end, `end` of a ray in `arriving`; `emission_share`: of its own emission that counts.
fn light_of_end(end: Hit, arriving: vec3f, emission_share: f32, numbers: Numbers) -> vec3f {
    var hit = end;
    var direction = arriving;
    var throughput = vec3f(1.0);
    var sum = vec3f(0.0);
    for (var k = 0u; k <= BOUNCES; k += 1u) {
        // Light samples find the emission of what bounced rays hit.
        let s = surface_at(hit, direction);
        let is_unlit = (s.flags & UNLIT) != 0u;
        if (k == 0u) {
            sum = select(s.emission * emission_share, s.base_color, is_unlit);
        }
        if (is_unlit) {
            return sum;
        }
        let p = path_point(s, direction);
        if (is_shown(p)) {
            return sum + throughput * picture_light(s.position);
        }
        let first = END_PAIRS + k * PAIRS_PER_BOUNCE;
        sum += throughput * reflected_radiance(p, no_arrival(), numbers.index, hash2(first, numbers.code));
        // Find the light of other surfaces by a ray.
        let drawn = sample_brdf(p.brdf, p.w_o, pair_of(numbers, first + 1u), pair_of(numbers, first + 2u).x);
        direction = normalize_or(p.frame * drawn.w_i, p.side);
        if (k == BOUNCES || drawn.pdf <= 0.0 || dot(direction, p.side) <= 0.0) {
            return sum;
        }
        hit = trace(Ray(leave_surface(s, direction), direction), FLOAT_MAX);
        if (hit.triangle == NONE) {
            return sum;
        }
        throughput *= drawn.weight * hit.tint;
    }
    return sum;
}
