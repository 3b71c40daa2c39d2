// A thread's sum over VPLs for its four pixels. The importing shader defines
// fn visibility(slot: u32, vpl: Vpl, at: Receivers) -> mat3x4f, from 0 to 1, rows of red, green, blue.
//
// E = n^2 sum_i Phi_i / pi cos_i cos_x V_i / (d_i^2 + s A_i / pi) over the VPLs i of the pixel's class, n^2 classes,
// with the bound of a disc of area A (Wallace et al. 1989, "A Ray Tracing Algorithm for Progressive Radiosity", eq. 5)
// and s = BOUND_SHARE. The base gets the share of each VPL's light that the coat transmits; the coat's own radiance is
// summed separately, over coat_tint(). Errs dark in corners, where VPLs are near.
//
// The four pixels of a thread are the components of vec4f, so that they share the loads of VPLs, which limit such loops
// on CPUs. There, workgroup memory and its barriers would cost more than they save (llvmpipe: 39 ms against 25).
#import "many_light/gather/common.wgsl"

// The bounded geometry terms between a VPL and the four pixels: cos cos / (d^2 + bound).
struct Terms {
    squared: vec4f,  // distances, m2
    terms: vec4f,    // 1/m2
}

// Returns the terms; rows of `position` and `normal` are x, y, z of the four. Both cosines are times d; the denominator
// stays above 0 where VPL and pixel meet.
fn geometry_terms(vpl: Vpl, bound: f32, position: mat3x4f, normal: mat3x4f) -> Terms {
    let x = position[0] - vpl.position.x;
    let y = position[1] - vpl.position.y;
    let z = position[2] - vpl.position.z;
    let squared = x * x + y * y + z * z;
    let leaving = max(x * vpl.normal.x + y * vpl.normal.y + z * vpl.normal.z, vec4f(0.0));
    let arriving = max(-(x * normal[0] + y * normal[1] + z * normal[2]), vec4f(0.0));
    return Terms(squared, leaving * arriving / max(squared * (squared + bound), vec4f(1e-37)));
}

// The response of the coats of the four pixels to a VPL; `reach` are the bounded squared distances, m2.
struct Shines {
    coat: mat3x4f,       // f_r, 1/sr
    transmitted: vec4f,
}

fn shines_of(vpl: Vpl, reach: vec4f, at: Receivers) -> Shines {
    let a = shine_at(at.a, vpl, reach.x);
    let b = shine_at(at.b, vpl, reach.y);
    let c = shine_at(at.c, vpl, reach.z);
    let d = shine_at(at.d, vpl, reach.w);
    return Shines(
        transpose(mat4x3f(a.coat, b.coat, c.coat, d.coat)),
        vec4f(a.transmitted, b.transmitted, c.transmitted, d.transmitted));
}

// Returns the flux towards the four pixels, rows of red, green, blue.
fn fluxes_of(vpl: Vpl, at: Receivers) -> mat3x4f {
    if (!HAS_LOBES) {
        return mat3x4f(vec4f(vpl.flux.r), vec4f(vpl.flux.g), vec4f(vpl.flux.b));
    }
    return transpose(mat4x3f(
        flux_towards(vpl, at.a.position - vpl.position), flux_towards(vpl, at.b.position - vpl.position),
        flux_towards(vpl, at.c.position - vpl.position), flux_towards(vpl, at.d.position - vpl.position)));
}

// Gathers from the VPLs of some words of the pixels' class and stores the results.
fn gather(place: Place, first_word: u32, word_count: u32) {
    if (any(place.pixel >= grid_size())) {
        return;
    }
    let at = load_receivers(place.pixel);
    let position = transpose(mat4x3f(at.a.position, at.b.position, at.c.position, at.d.position));
    let normal = transpose(mat4x3f(at.a.normal, at.b.normal, at.c.normal, at.d.normal));
    let begin = lists_of(place);

    var sum = mat3x4f();  // red, green, blue of the four
    var shine = mat3x4f();
    for (var k = 0u; k < word_count; k += 1u) {
        // Loop over the VPLs in the list of any of the four pixels.
        let word = first_word + k;
        var bits = slots_of_word(params.vpl_count, place.class_number, word);
        if (CULLED) {
            bits = lists[begin.x + word] | lists[begin.y + word] | lists[begin.z + word] | lists[begin.w + word];
        }
        while (bits != 0u) {
            let slot = slot_of(place.class_number, 32u * word + firstTrailingBit(bits));
            bits &= bits - 1u;
            let vpl = load_vpl_with_lobe(slot);
            // Skip a VPL that faces none of them.
            let bound = bound_of(vpl);
            let geometry = geometry_terms(vpl, bound, position, normal);
            if (all(geometry.terms <= vec4f(0.0))) {
                continue;
            }
            // Add the light that arrives. The near field takes its share of diffuse light only, not of the coats'.
            let visible = visibility(slot, vpl, at);
            let far = far_field_shares(slot, geometry.squared, at);
            let flux = fluxes_of(vpl, at);
            let red = flux[0] * (geometry.terms * visible[0]);
            let green = flux[1] * (geometry.terms * visible[1]);
            let blue = flux[2] * (geometry.terms * visible[2]);
            if (HAS_COATS) {
                let coats = shines_of(vpl, geometry.squared + bound, at);
                let transmitted = far * coats.transmitted;
                sum[0] += transmitted * red;
                sum[1] += transmitted * green;
                sum[2] += transmitted * blue;
                shine[0] += red * coats.coat[0];
                shine[1] += green * coats.coat[1];
                shine[2] += blue * coats.coat[2];
            } else {
                sum[0] += far * red;
                sum[1] += far * green;
                sum[2] += far * blue;
            }
        }
    }
    // Each class has 1 / n^2 of the VPLs.
    let scale = f32(class_count()) * INV_PI;
    store_results(place, transpose(sum) * scale, transpose(shine) * scale, at);
}
