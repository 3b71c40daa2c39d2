// The bound on the geometry term of near VPLs: cos cos / (d^2 + s A / pi).
#import "many_light/vpl/vpl.wgsl"

// Share of a VPL's area that bounds its light. Eight random rooms, Lambert, all bounces, 64x36, with compensation: 0.25
// is noisier (a single frame has relMSE 0.047, with 0.5 0.042); 1 leaves a bias of -0.9 %, 0.5 one of -0.6 %.
const BOUND_SHARE: f32 = 0.5;

override BOUNDED: bool = true;  // bound the geometry term by the VPL's area

// Returns the bound's addition to the squared distance in the geometry term, m2.
fn bound_of(vpl: Vpl) -> f32 {
    return select(0.0, BOUND_SHARE * INV_PI * vpl.area, BOUNDED);
}
