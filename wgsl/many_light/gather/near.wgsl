// The share of a VPL's light that the VPL gives: 1 less the weight with which the near field finds its surface
// (`ssdo/search_radius.wgsl`), so that both add up to all of it.
#import "ssdo/search_radius.wgsl"

override NEAR: bool = false;  // there is a near field

// Returns that share for a receiver at the squared distance `squared`; `shown`: of `many_light/near/shares.wgsl`.
fn far_share(shown: f32, squared: f32, reach: f32) -> f32 {
    if (!NEAR) {
        return 1.0;
    }
    return 1.0 - shown * distance_fade(reach, sqrt(squared));
}
