// The sum over VPLs that a thread makes for its pixels. Who imports this defines
// fn visibility(slot: u32, vpl: Vpl, at: Four) -> vec4f, from 0 to 1.
//
// E = n^2 sum_i Phi_i / pi cos_i cos_x V_i / (d_i^2 + A_i / pi) over the VPLs i of the pixel's class, n^2 classes, with
// the bound of a disc of area A (Wallace et al. 1989, "A Ray Tracing Algorithm for Progressive Radiosity", eq. 5). Of
// coated surfaces each VPL's light is times 1 - F, what the coat lets through, and the coat's own radiance is summed
// beside it, over coat_tint(). Errs dark in corners.
//
// The four pixels of a thread are the components of vec4f, so that they share the loads of VPLs, which bind such loops
// on CPUs. There, workgroup memory and its barriers would cost more than they save (llvmpipe: 39 ms against 25).
#import "many_light/gather/common.wgsl"

fn gather(place: Place, first_word: u32, word_count: u32) {
    let step = vec2u(0u, INTERLEAVE);
    if (any(place.pixel >= view.size)) {
        return;
    }
    let at = load_four(place.pixel);
    let a = at.a;
    let b = at.b;
    let c = at.c;
    let d = at.d;
    let position = transpose(mat4x3f(a.position, b.position, c.position, d.position));
    let normal = transpose(mat4x3f(a.normal, b.normal, c.normal, d.normal));
    let begin = lists_of(place);

    var sum = mat3x4f();  // red, green, blue of the four
    var shine = mat3x4f();
    var bounds = Bounds(vec4f(0.0), vec4f(0.0));
    for (var k = 0u; k < word_count; k += 1u) {
        let word = first_word + k;
        var bits = slots_of_word(params.vpl_count, place.class_number, word);
        if (CULLED) {
            bits = lists[begin.x + word] | lists[begin.y + word] | lists[begin.z + word] | lists[begin.w + word];
        }
        while (bits != 0u) {
            let slot = slot_of(place.class_number, 32u * word + firstTrailingBit(bits));
            bits &= bits - 1u;
            let vpl = load_vpl(slot);
            let x = position[0] - vpl.position.x;
            let y = position[1] - vpl.position.y;
            let z = position[2] - vpl.position.z;
            let squared = x * x + y * y + z * z;
            let leaving = max(x * vpl.normal.x + y * vpl.normal.y + z * vpl.normal.z, vec4f(0.0));
            let arriving = max(-(x * normal[0] + y * normal[1] + z * normal[2]), vec4f(0.0));
            let bound = bound_of(vpl);
            // Both cosines still have a length of d. Above zero, for 0 / 0 where VPL and pixel meet.
            var term = leaving * arriving / max(squared * (squared + bound), vec4f(1e-37));
            if (all(term <= vec4f(0.0))) {
                continue;
            }
            if (COMPENSATED) {
                bounds = add_bound(bounds, bound, squared, luminance(vpl.flux) * term);
            }
            term *= visibility(slot, vpl, Four(a, b, c, d));
            let red = vpl.flux.r * term;
            let green = vpl.flux.g * term;
            let blue = vpl.flux.b * term;
            // Of what a near VPL gives, coats keep their part.
            var far = vec4f(1.0);
            if (NEAR) {
                let near = load_near_share(slot);
                far = vec4f(
                    far_share(near, squared.x, a.reach), far_share(near, squared.y, b.reach),
                    far_share(near, squared.z, c.reach), far_share(near, squared.w, d.reach));
            }
            if (HAS_COATS) {
                let reach = squared + bound;
                let sa = shine_of(a.brdf, a.normal, a.to_eye, vpl.position - a.position, reach.x, vpl.area);
                let sb = shine_of(b.brdf, b.normal, b.to_eye, vpl.position - b.position, reach.y, vpl.area);
                let sc = shine_of(c.brdf, c.normal, c.to_eye, vpl.position - c.position, reach.z, vpl.area);
                let sd = shine_of(d.brdf, d.normal, d.to_eye, vpl.position - d.position, reach.w, vpl.area);
                let fresnel = transpose(mat4x3f(sa.fresnel, sb.fresnel, sc.fresnel, sd.fresnel));
                let lobe = vec4f(sa.lobe, sb.lobe, sc.lobe, sd.lobe);
                sum[0] += far * red * (1.0 - fresnel[0]);
                sum[1] += far * green * (1.0 - fresnel[1]);
                sum[2] += far * blue * (1.0 - fresnel[2]);
                shine[0] += red * fresnel[0] * lobe;
                shine[1] += green * fresnel[1] * lobe;
                shine[2] += blue * fresnel[2] * lobe;
            } else {
                sum[0] += far * red;
                sum[1] += far * green;
                sum[2] += far * blue;
            }
        }
    }
    let scale = f32(class_count()) * INV_PI;
    let colors = transpose(sum) * scale;
    let coats = transpose(shine) * scale;
    let means = transpose(mat2x4f(bounds.bounds, bounds.weights));
    store(place.pixel, colors[0], coats[0], means[0], a);
    store(place.pixel + step, colors[1], coats[1], means[1], b);
    store(place.pixel + 2u * step, colors[2], coats[2], means[2], c);
    store(place.pixel + 3u * step, colors[3], coats[3], means[3], d);
}
