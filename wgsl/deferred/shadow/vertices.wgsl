// A vertex in the clip space of a shadow view. The instance number holds the view above SLOT_BITS and the instance
// slot below. Depth is reversed: 1 is nearest to the light.
#import "shared/gbuffer/vertices.wgsl"
#import "deferred/shadow/views.wgsl"

override SLOT_BITS: u32 = 16u;  // enough for the slots; more bits for slots leave fewer for views

@group(1) @binding(26) var<storage, read> shadow_views: array<ShadowView>;

fn shadow_vertex(index: u32, slot: u32) -> vec4f {
    let v = raster_vertex(index, slot & ((1u << SLOT_BITS) - 1u));
    return shadow_views[slot >> SLOT_BITS].clip_from_world * vec4f(v.position, 1.0);
}
