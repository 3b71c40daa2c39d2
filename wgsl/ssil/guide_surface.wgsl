// A surfel's surface for joint bilateral upsampling.
#import "shared/upsample/weights.wgsl"
#import "ssil/surfel.wgsl"

fn surfel_guide_surface(texel: vec4u) -> GuideSurface {
    return GuideSurface(surfel_position(texel), surfel_normal(texel), !is_empty(texel));
}
