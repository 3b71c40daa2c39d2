// The light of a VPL that is left to the near field, where that finds its surface itself: what `ssdo/search_radius.wgsl` has it
// count, so that both together are all of it.
#import "ssdo/search_radius.wgsl"

override NEAR: bool = false;  // there is a near field

// Returns how much of a VPL's light comes by VPLs, not by the near field. `shown` as `many_light/near/shares.wgsl` has it.
fn far_share(shown: f32, squared: f32, reach: f32) -> f32 {
    if (!NEAR) {
        return 1.0;
    }
    return 1.0 - shown * distance_fade(reach, sqrt(squared));
}
