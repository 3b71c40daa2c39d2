// The medium that a path travels in: what a solid absorbs (Beer's law), and its index of refraction.
//
// A path is inside a solid after it has crossed its surface, and wherever its ray arrives at the back of one. Leaving a
// solid leads to air: a solid in another one is known again where the ray arrives at the outer one's back. All indices are
// relative to air. Light that leaves an emitter in a solid and arrives at an opaque surface in it is not absorbed if a light
// ray finds it.
#import "scene/surface.wgsl"

struct Medium {
    absorption: vec3f,   // 1/m
    squared_index: f32,  // of refraction
}

fn air() -> Medium {
    return Medium(vec3f(0.0), 1.0);
}

// Returns the medium that a ray which arrives at a surface has travelled in. `m`: that at its start.
fn medium_before(s: Surface, m: Medium) -> Medium {
    if (has_volume(s.layers) && !s.front) {
        return Medium(s.layers.attenuation, s.layers.ior * s.layers.ior);
    }
    return m;
}

// Returns whether a direction leads to the side of a surface that its viewer does not see.
fn crosses(s: Surface, direction: vec3f) -> bool {
    return s.front == (dot(s.geometric_normal, direction) < 0.0);
}

// Returns the medium in a direction from a surface. `m`: that on the viewer's side.
fn medium_beyond(s: Surface, direction: vec3f, m: Medium) -> Medium {
    if (has_volume(s.layers) && crosses(s, direction)) {
        if (s.front) {
            return Medium(s.layers.attenuation, s.layers.ior * s.layers.ior);
        }
        return air();
    }
    return m;
}

// Returns whether both normals agree on whether a direction crosses the surface; `w_i` is in the shading normal's frame.
// Otherwise light would be refracted without entering the solid.
fn sides_agree(s: Surface, brdf: Brdf, direction: vec3f, w_i: vec3f) -> bool {
    return !HAS_TRANSMISSION || max3(brdf.transmitted) <= 0.0 || crosses(s, direction) == (w_i.z < 0.0);
}
