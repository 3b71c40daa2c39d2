// One fragment draws a pixel of the window: a picture, a second one right of `split` for comparison, and a panel's
// background.
//
// The background is part of this pass: blending it afterwards would double the time.
// In: both 8-bit sRGB, of any size. Out: 8-bit sRGB, one pixel of the window.

struct Screen {
    panel: vec4f,  // left, top, right, bottom of a panel's background, shares of width and height
    split: f32,    // share of the window's width where the other picture begins; 1 or more: no other picture
    line: f32,     // half the width of the line between them, as a share of the window's width
}

const BACKGROUND = vec4f(0.06, 0.06, 0.06, 0.85);  // colour and opacity, by taste

@group(0) @binding(0) var picture: texture_2d<f32>;
@group(0) @binding(1) var other: texture_2d<f32>;
@group(0) @binding(2) var smooth_sampler: sampler;
@group(0) @binding(3) var<uniform> screen: Screen;

struct Corner {
    @builtin(position) position: vec4f,
    @location(0) place: vec2f,
}

@vertex
fn corner(@builtin(vertex_index) index: u32) -> Corner {
    let place = vec2f(f32(index & 1u), f32(index >> 1u)) * 2.0;
    return Corner(vec4f(place.x * 2.0 - 1.0, 1.0 - place.y * 2.0, 0.0, 1.0), place);
}

@fragment
fn pixel(in: Corner) -> @location(0) vec4f {
    let left = textureSampleLevel(picture, smooth_sampler, in.place, 0.0);
    let right = textureSampleLevel(other, smooth_sampler, in.place, 0.0);
    let color = select(left, right, in.place.x >= screen.split).rgb;
    let divided = select(color, vec3f(1.0), abs(in.place.x - screen.split) < screen.line);
    let inside = all(in.place >= screen.panel.xy) && all(in.place < screen.panel.zw);
    return vec4f(mix(divided, BACKGROUND.rgb, select(0.0, BACKGROUND.a, inside)), 1.0);
}
