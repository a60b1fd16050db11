// Adds the needle's echoes to the focused lines, with the loss of the scanline up to the needle. One thread per
// scanline, which adds its echoes in order.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> starts: array<f32>;
@group(0) @binding(2) var<storage, read> segments: array<Segment>;
// Index of each scanline's first echo, then the number of all.
@group(0) @binding(3) var<storage, read> needle_starts: array<u32>;
// Depth (mm), added range (mm; below 0: minus the number of round trips), amplitude, phase (turns).
@group(0) @binding(4) var<storage, read> needle_echoes: array<vec4<f32>>;
// This and the next one are read if APERTURE.
@group(0) @binding(5) var<uniform> aperture: Aperture;
@group(0) @binding(6) var<storage, read> line_gains: array<vec4<f32>>;
@group(0) @binding(7) var<storage, read_write> focused: array<vec2<f32>>;
// Weights of an echo on the four samples around it, for even steps from one sample to the next. Read if BETWEEN.
@group(0) @binding(8) var<uniform> delays: array<vec4<f32>, DELAY_STEPS + 1u>;

// Whether the aperture gain replaces the loss of the axial path.
override APERTURE: bool = false;
// Whether an echo is spread over the samples around it; else it lies at the nearest one.
override BETWEEN: bool = false;

// Factor of the echoes.
const NEEDLE_AMPLITUDE: f32 = 1.0;

// Depth per mm of range on a segment; 1 on reflected segments.
fn rate_of(path: u32, at: u32) -> f32 {
    let rate = length(segments[path * SEGMENTS + at].step);
    return select(rate, 1.0, has_reflected(path, at) || rate < 0.1);
}

// Adds a value to a sample of a scanline, if it has that sample.
fn add(line: u32, sample: i32, value: vec2<f32>) {
    if sample >= 0 && sample < i32(params.samples) {
        focused[line * params.row_samples + u32(sample)] += value;
    }
}

fn add_echo(line: u32, echo: vec4<f32>) {
    let path = axial_path_of(line);
    // Segment that holds the depth. Media of other speeds than 1540 m/s make the range differ from the depth.
    var at = 0u;
    var left_mm = echo.x;
    while at + 1u < SEGMENTS {
        let through_mm = (starts[path * STARTS + at + 1u] - starts[path * STARTS + at]) * rate_of(path, at);
        if through_mm >= left_mm {
            break;
        }
        left_mm -= through_mm;
        at++;
    }
    let reached_mm = starts[path * STARTS + at] + left_mm / rate_of(path, at);
    var ln_gain = 0.0;
    if APERTURE {
        ln_gain = scatterer_gain_at(line, reached_mm, loss_on(path, at, reached_mm));
    } else {
        let slot = path * SEGMENTS + at;
        ln_gain = segments[slot].ln_amplitude_at_zero - segments[slot].fall_np_mm * reached_mm;
    }
    let trips = max(-echo.y, 1.0);
    let range_mm = trips * reached_mm + max(echo.y, 0.0);
    let sample = range_mm / params.sample_spacing_mm;
    if !(sample >= 0.0 && sample < f32(params.samples)) {
        return;
    }
    let amplitude = NEEDLE_AMPLITUDE * echo.z * exp(max(trips * ln_gain, -80.0));
    let value = amplitude * times(phasor(-params.phase_turns_per_mm * range_mm), phasor(echo.w));
    if !BETWEEN {
        add(line, i32(sample), value);
        return;
    }
    // Samples are centred half a spacing after their number.
    let before = floor(sample - 0.5);
    let step = (sample - 0.5 - before) * f32(DELAY_STEPS);
    let low = min(u32(step), DELAY_STEPS - 1u);
    let weights = mix(delays[low], delays[low + 1u], step - f32(low));
    for (var tap = 0; tap < 4; tap++) {
        add(line, i32(before) - 1 + tap, weights[tap] * value);
    }
}

@compute @workgroup_size(16)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let line = id.x;
    if line >= params.scanlines {
        return;
    }
    for (var i = needle_starts[line]; i < needle_starts[line + 1u]; i++) {
        add_echo(line, needle_echoes[i]);
    }
}
