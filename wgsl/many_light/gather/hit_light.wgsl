// The light of one VPL at a surface point that a ray has hit, and the share of light that VPLs' bounds remove there. The
// importing shader declares `params` with vpl_count. Errs blurry: the lobes of VPLs are widened by their distance.
#import "deferred/hit_light.wgsl"
#import "common/coat.wgsl"
#import "many_light/vpl/table.wgsl"
#import "many_light/vpl/lobe.wgsl"
#import "many_light/gather/bound.wgsl"
#import "many_light/near_field/share.wgsl"

override REFLECTS_VPLS: bool = true;

// Candidates for the VPL that lights y, drawn by their unshadowed light (Talbot et al. 2005). 128 take 5 % more time of
// a frame of 320x180 and are no less noisy.
const CANDIDATES: u32 = 32u;
// q over the mean bound of all VPLs: more is less noisy and takes more time, since more rays hit.
const PROPOSED: f32 = 2.0;

// What the VPLs say about a point: the light of one of them there, and the share of light that their bound removes.
struct VplsAtPoint {
    arrival: Arrival,
    removed: f32,       // 0 to 1
}

// Draws a VPL in proportion to its light at a point, and averages the share that the bounds of VPLs nearby remove at a
// squared distance; if none lies on a surface like that of the point, the share of the mean bound. `reach`: q, the
// squared radius of the kernel of that mean, m2.
fn vpls_at_point(p: PathPoint, squared_distance: f32, reach: f32, u: vec2f) -> VplsAtPoint {
    var sum = 0.0;
    var color = vec3f(0.0);
    var chosen_way = vec3f(0.0);
    var random = u.y;
    var removed = 0.0;
    var weights = 0.0;
    for (var k = 0u; k < CANDIDATES; k += 1u) {
        let slot = min(u32((f32(k) + u.x) / f32(CANDIDATES) * f32(params.vpl_count)), params.vpl_count - 1u);
        var vpl = load_vpl_with_lobe(slot);
        let way = vpl.position - p.surface.position;
        let squared = dot(way, way);
        let bound = bound_of(vpl);
        // Bright VPLs lose more light to their bound.
        let near = reach / (squared + reach);
        let near_weight = luminance(vpl.flux) * near * near;
        let counts = select(0.0, near_weight, dot(p.side, vpl.normal) > SIMILAR_NORMALS);
        removed += counts * bound / max(squared_distance + bound, 1e-37);
        weights += counts;
        if (!REFLECTS_VPLS || vpl.last) {
            continue;
        }
        let leaving = max(-dot(way, vpl.normal), 0.0);
        let arriving = max(dot(way, p.surface.normal), 0.0);
        let geometry = leaving * arriving / max(squared * (squared + bound), 1e-37);
        // A candidate stands for its part of all VPLs: widen its lobe as much.
        vpl.area *= f32(params.vpl_count) / f32(CANDIDATES);
        let flux = widened_flux_towards(vpl, -way, squared + bound);
        let weight = luminance(flux) * geometry;
        if (weight > 0.0) {
            // Keep this candidate with the probability weight / sum, and use the random number again.
            sum += weight;
            let share = weight / sum;
            let takes = random < share;
            random = select((random - share) / max(1.0 - share, 1e-7), random / share, takes);
            if (takes) {
                color = flux / luminance(flux);
                chosen_way = way;
            }
        }
    }
    // Reflect the light of the chosen candidate, over its probability.
    let to_vpl = normalize_or(chosen_way, p.side);
    let reflected = reflectance_towards(p, to_vpl);
    let scale = sum * INV_PI * f32(params.vpl_count) / f32(CANDIDATES);
    let chosen = Arrival(color * reflected * scale, chosen_way, select(0.0, STOP_SHORT, sum > 0.0));
    let usual = reach / PROPOSED;
    let mean = removed / max(weights, 1e-37);
    return VplsAtPoint(chosen, select(usual / max(squared_distance + usual, 1e-37), mean, weights > 0.0));
}
