// The share of the light of a surface point that the near field finds at distance 0: 0 if the picture does not show the
// point, else 1, fading to 0 at the picture's border (`border_fade`). Errs at silhouettes, by a pixel.
#import "shared/gbuffer/read.wgsl"
#import "ssdo/search_radius.wgsl"

// A point lies on a pixel's surface if its distances from the surface's tangent plane and point are at most these, in
// pixel widths: up to the pixel's footprint at grazing angles. tools/README.md, "Constants".
const MAX_PLANE_DISTANCE: f32 = 1.0;
const MAX_POINT_DISTANCE: f32 = 16.0;
// The cosine of both normals must also be at least this: half-way between one wall and two walls at a right angle.
const SIMILAR_NORMALS: f32 = 0.5;

// Returns the share of a point; `side`: unit normal on the side that it lights.
fn near_share_of(position: vec3f, side: vec3f) -> f32 {
    // Find the pixel that the point falls on.
    let clip = view.clip_from_world * vec4f(position, 1.0);
    let size = vec2f(view.size);
    let place = (clip.xy / clip.w * vec2f(0.5, -0.5) + 0.5) * size;
    let inside = clip.w > 0.0 && all(place >= vec2f(0.0)) && all(place < size);
    let pixel = vec2u(select(vec2f(0.0), place, inside));
    // Compare the point with the surface of that pixel.
    let seen = load_distance(pixel);
    let surface = load_surface(pixel);
    let ray = pixel_ray(pixel);
    let way = position - (ray.origin + ray.direction * seen);
    let faces = dot(surface.geometric_normal, ray.direction) < 0.0;
    let normal = select(-surface.geometric_normal, surface.geometric_normal, faces);
    let depth = select(seen * dot(ray.direction, view.forward), 1.0, view.orthographic != 0u);
    let width = 2.0 * length(view.up) * depth / size.y;
    let same = abs(dot(way, normal)) <= MAX_PLANE_DISTANCE * width && length(way) <= MAX_POINT_DISTANCE * width
        && dot(side, normal) >= SIMILAR_NORMALS;
    let lit = seen > 0.0 && (surface.flags & GBUFFER_UNLIT) == 0u;
    return select(0.0, border_fade(vec2f(pixel) + 0.5, size), inside && lit && same);
}
