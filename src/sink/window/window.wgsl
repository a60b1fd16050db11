// The live window: the grey picture in its rectangle, and marks over the whole window.

struct Placement {
    // Picture: left, top, width, height, pixels of the window.
    picture: vec4<f32>,
    // Window pixels per pixel of the marks.
    marks_scale: f32,
    // 1 if the surface stores sRGB and converts written values, else 0.
    surface_is_srgb: f32,
    // Brightness of the picture: below 1 if it can't be trusted.
    brightness: f32,
    unused: f32,
}

@group(0) @binding(0) var<uniform> placement: Placement;
@group(0) @binding(1) var picture: texture_2d<f32>;
@group(0) @binding(2) var marks: texture_2d<f32>;
@group(0) @binding(3) var smooth_sampler: sampler;

@vertex
fn vertex(@builtin(vertex_index) index: u32) -> @builtin(position) vec4<f32> {
    // One triangle that covers the window.
    let corner = vec2<f32>(f32(index & 1u), f32(index >> 1u));
    return vec4<f32>(4.0 * corner - 1.0, 0.0, 1.0);
}

fn linear_from_srgb(value: vec3<f32>) -> vec3<f32> {
    let low = value / 12.92;
    let high = pow((value + 0.055) / 1.055, vec3<f32>(2.4));
    return select(high, low, value <= vec3<f32>(0.04045));
}

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let at = (position.xy - placement.picture.xy) / placement.picture.zw;
    let inside = all(at >= vec2<f32>(0.0)) && all(at < vec2<f32>(1.0));
    let grey = textureSampleLevel(picture, smooth_sampler, clamp(at, vec2<f32>(0.0), vec2<f32>(1.0)), 0.0).r;
    let below = vec3<f32>(select(0.0, grey * placement.brightness, inside));
    let mark = textureLoad(marks, vec2<i32>(position.xy / placement.marks_scale), 0);
    let colour = mix(below, mark.rgb, mark.a);
    return vec4<f32>(mix(colour, linear_from_srgb(colour), placement.surface_is_srgb), 1.0);
}
