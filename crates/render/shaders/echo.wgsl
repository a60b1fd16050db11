// Adds the interfaces' echoes to the baseband. Each scanline's echoes are added in the order of its paths, so that
// float sums are reproducible without atomics. The entry points are in shared/echo_by_group.wgsl and
// shared/echo_by_line.wgsl.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> starts: array<f32>;
@group(0) @binding(2) var<storage, read> segments: array<Segment>;
@group(0) @binding(3) var<storage, read> echoes: array<vec2<f32>>;
@group(0) @binding(4) var<storage, read> segment_counts: array<u32>;
// This and the next one are read if APERTURE.
@group(0) @binding(5) var<uniform> aperture: Aperture;
@group(0) @binding(6) var<storage, read> line_gains: array<vec4<f32>>;
@group(0) @binding(7) var<storage, read_write> baseband: array<vec2<f32>>;
// Weights of an echo on the four samples around it, for even steps from one sample to the next. Read if BETWEEN.
@group(0) @binding(8) var<uniform> delays: array<vec4<f32>, DELAY_STEPS + 1u>;

// Whether the aperture gain replaces the loss of paths that have not reflected.
override APERTURE: bool = false;
// Whether an echo is spread over the samples around it; else it lies at the nearest one.
override BETWEEN: bool = false;

// Loss of a path from the face to the start of a depth interval, on its segments up to index `arrived`.
fn loss_at_interval(path: u32, arrived: u32, interval: u32) -> f32 {
    let range_mm = f32(interval) * aperture.plane_mm;
    var at = arrived;
    while at > 0u && starts[path * STARTS + at] > range_mm {
        at--;
    }
    return loss_on(path, at, range_mm);
}

// How far a scanline's position among the depth planes lags behind at the end of an interval: 1 without an own loss in
// the interval (one-way nepers), 0 for a very large one.
fn lags(own_np: f32) -> f32 {
    return TRACKED_NP / (max(own_np, 0.0) + TRACKED_NP);
}

// ln of the two-way amplitude that returns from the interface at the end of segment `arrived`: the aperture gain before
// the obstacles that the path has not crossed yet.
fn interface_gain(line: u32, path: u32, arrived: u32) -> f32 {
    let range_mm = starts[path * STARTS + arrived + 1u];
    let index = interval_index(range_mm);
    var interval = interval_at(line, index);
    let begins_np = loss_at_interval(path, arrived, index);
    if index > 0u {
        let last = interval_at(line, index - 1u);
        let lag = (f32(index) - interval.start) / lags(own_np(last));
        let path_np = begins_np - loss_at_interval(path, arrived, index - 1u) - last.row_np;
        interval.start = f32(index) - lags(path_np) * clamp(lag, 0.0, 1.0);
    }
    let part = range_mm / aperture.plane_mm - f32(index);
    let rise_np = loss_on(path, arrived, range_mm) - begins_np;
    let lost = lost_part(interval, part, rise_np + interval.begins_np);
    // The gain is at most that at the interval's plane, which lies before what the path has not crossed.
    let path_np = max(rise_np - interval.row_np * lost, 0.0);
    let furthest = max(f32(index) + path_np / (path_np + TRACKED_NP), interval.start);
    let position = min(position_within(interval, part, lost), furthest);
    return gain_at(line, position) - 2.0 * (interval.shared_np + interval.row_np * lost);
}

// An echo: its value, and the first of the samples to which it is added with `weights`. Samples beyond the row's ends
// take nothing. `sample` is NO_SAMPLE for an echo beyond the row, and for one without amplitude.
struct Echo {
    sample: i32,
    value: vec2<f32>,
    weights: vec4<f32>,
}

const NO_SAMPLE: i32 = 0x7fffffff;

// Number of samples to which an echo is added.
fn taps() -> i32 {
    return select(1, 4, BETWEEN);
}

// Whether a sample lies in the row.
fn in_row(sample: i32) -> bool {
    return sample >= 0 && sample < i32(params.samples);
}

// Echo of the interface at the start of a segment, times `weight`.
fn echo_of(line: u32, path: u32, segment: u32, weight: f32) -> Echo {
    let echo = echoes[path * SEGMENTS + segment];
    let sample = echo.y / params.sample_spacing_mm;
    if echo.x == 0.0 || sample < 0.0 || sample >= f32(params.samples) {
        return Echo(NO_SAMPLE, vec2<f32>(0.0), vec4<f32>(0.0));
    }
    var amplitude = weight * echo.x;
    if APERTURE && !has_reflected(path, segment - 1u) {
        amplitude *= exp(max(interface_gain(line, path, segment - 1u), -80.0));
    }
    let value = amplitude * phasor(-params.phase_turns_per_mm * echo.y);
    if !BETWEEN {
        return Echo(i32(sample), value, vec4<f32>(1.0));
    }
    // Samples are centred half a spacing after their number.
    let before = floor(sample - 0.5);
    let step = (sample - 0.5 - before) * f32(DELAY_STEPS);
    let low = min(u32(step), DELAY_STEPS - 1u);
    let weights = mix(delays[low], delays[low + 1u], step - f32(low));
    return Echo(i32(before) - 1, value, weights);
}

// Number of echoes of a path: one at the start of each segment but the first.
fn count_of(path: u32) -> u32 {
    return max(segment_counts[path], 1u) - 1u;
}

// Index of the `ordinal`-th path of a scanline in this batch: rays fastest, then layers.
fn path_of(line: u32, ordinal: u32) -> u32 {
    let of_batch = ordinal / params.rays * params.line_count + line - params.line_first;
    return of_batch * params.rays + ordinal % params.rays;
}
