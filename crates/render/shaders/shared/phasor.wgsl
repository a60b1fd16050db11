// e^(i2π·turns), with an error of 2·10⁻⁷ on every device: WGSL lets sin and cos be off by 2⁻¹¹. Minimax polynomials in
// turns², each over a quarter turn to either side.
fn phasor(turns: f32) -> vec2<f32> {
    let within = turns - round(turns);
    let halves = round(2.0 * within);
    let r = within - 0.5 * halves;
    let u = r * r;
    let c = 0.99999994 + u * (-19.739172 + u * (64.93459 + u * (-85.240326 + u * 56.242363)));
    let s = r * (6.283185 + u * (-41.341656 + u * (81.601006 + u * (-76.54978 + u * 39.536697))));
    return vec2<f32>(c, s) * (1.0 - 2.0 * abs(halves));
}

// Product of two complex numbers.
fn times(a: vec2<f32>, b: vec2<f32>) -> vec2<f32> {
    return vec2<f32>(a.x * b.x - a.y * b.y, a.x * b.y + a.y * b.x);
}
