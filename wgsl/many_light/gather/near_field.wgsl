// The part of a VPL's light that the near field finds in screen space and gathering leaves out (Ritschel et al. 2009,
// section 5). Both parts have the weights of `ssdo/search_radius.wgsl`, so they add up to all of the light.
#import "ssdo/search_radius.wgsl"

override NEAR_FIELD: bool = false;  // there is a near field

// Returns the share of a VPL's light that gathering adds. `shown`: the near field's share at distance 0, from
// `many_light/near_field/shares.wgsl`; `squared`: squared distance, m2; `radius`: r_max, metres.
fn far_field_share(shown: f32, squared: f32, radius: f32) -> f32 {
    if (!NEAR_FIELD) {
        return 1.0;
    }
    return 1.0 - shown * distance_fade(radius, sqrt(squared));
}
