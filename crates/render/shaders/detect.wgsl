// Axial pulse, envelope, TGC and log compression.
// In: focused baseband, two samples per vector. Out: one word per grey level with this level and the next one,
// 0..=65535, for scan conversion; with KEEP_LINES also the baseband after the pulse. A thread makes eight levels: those
// of eight samples, or with MIDWAY those of four samples, each followed by the level midway to the next sample.

@group(0) @binding(0) var<uniform> params: Params;
// Envelope of the pulse, with PULSE_PAD zeros before and after it; then its taps midway between samples, with the same
// zeros.
@group(0) @binding(1) var<uniform> pulse: array<vec4<f32>, 2u * PULSE_QUADS>;
@group(0) @binding(2) var<storage, read> focused: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> polar: array<vec4<u32>>;
@group(0) @binding(4) var<storage, read_write> lines: array<vec4<f32>>;

override KEEP_LINES: bool = false;
override MIDWAY: bool = false;

fn tap(index: i32) -> f32 {
    return pulse[u32(index) >> 2u][u32(index) & 3u];
}

fn tap_midway(index: i32) -> f32 {
    return pulse[PULSE_QUADS + (u32(index) >> 2u)][u32(index) & 3u];
}

// Samples `at` and `at` + 1 of a row; 0 beyond its ends.
fn pair_at(row: u32, at: i32) -> vec4<f32> {
    let last = i32(params.samples) - 1;
    let pair = focused[(row + u32(clamp(at, 0, i32(params.row_samples) - 2))) >> 1u];
    let first_there = at >= 0 && at <= last;
    let second_there = at + 1 >= 0 && at + 1 <= last;
    return select(vec4<f32>(0.0), pair, vec4<bool>(first_there, first_there, second_there, second_there));
}

// Gain of the TGC sliders at a depth, dB, interpolated linearly.
fn slider_db(depth_mm: f32) -> f32 {
    let position = clamp(7.0 * depth_mm / params.depth_mm, 0.0, 7.0);
    let below = min(u32(position), 6u);
    let low = image_tgc_sliders_db(below);
    let high = image_tgc_sliders_db(below + 1u);
    return mix(low, high, position - f32(below));
}

// Grey levels 0..=1 of four samples from `first` on, from their powers; with MIDWAY, of two samples and of the places
// midway to the next ones.
fn levels(first: u32, power: vec4<f32>) -> vec4<f32> {
    let offsets = select(vec4<f32>(0.5, 1.5, 2.5, 3.5), vec4<f32>(0.5, 1.0, 1.5, 2.0), MIDWAY);
    let depth_mm = (offsets + f32(i32(first))) * params.sample_spacing_mm;
    // The least power is far below any display.
    let level_db = DB_A_DOUBLING * log2(max(power, vec4<f32>(1.0e-37)))
        + image_gain_db() + params.tgc_db_per_mm * depth_mm
        + vec4<f32>(slider_db(depth_mm.x), slider_db(depth_mm.y), slider_db(depth_mm.z), slider_db(depth_mm.w));
    return clamp(1.0 + level_db / image_dynamic_range_db(), vec4<f32>(0.0), vec4<f32>(1.0));
}

fn powers(a: vec4<f32>, b: vec4<f32>) -> vec4<f32> {
    return vec4<f32>(dot(a.xy, a.xy), dot(a.zw, a.zw), dot(b.xy, b.xy), dot(b.zw, b.zw));
}

// Packs each of four levels with the next one; `next` follows the fourth.
fn pairs(level: vec4<f32>, next: f32) -> vec4<u32> {
    return vec4<u32>(pack2x16unorm(level.xy), pack2x16unorm(level.yz), pack2x16unorm(level.zw), pack2x16unorm(vec2<f32>(level.w, next)));
}

// Levels of four samples from `first` on, and midway to the next ones.
fn detect_with_midway(row: u32, first: i32) {
    let half = i32(params.axial_half);
    let even = (half + 1) & ~1;
    // Baseband at the four samples and the next one, and midway after the four.
    var at = array<vec2<f32>, 5>();
    var midway = array<vec2<f32>, 4>();
    // Sliding windows of six taps; each pair of samples shifts them by two.
    var taps = array<f32, 6>();
    var taps_midway = array<f32, 6>();
    for (var step = 0; step <= 2 * even + 4; step += 2) {
        let pair = pair_at(row, first - even + step);
        // Tap half + PULSE_PAD + d weights a sample d after the output.
        let index = step - even + half + PULSE_PAD;
        for (var i = 0; i < 4; i++) {
            taps[i] = taps[i + 2];
            taps_midway[i] = taps_midway[i + 2];
        }
        for (var i = 0; i < 2; i++) {
            taps[4 + i] = tap(index + i);
            taps_midway[4 + i] = tap_midway(index + i);
        }
        for (var i = 0; i < 5; i++) {
            at[i] += pair.xy * taps[4 - i] + pair.zw * taps[5 - i];
        }
        for (var i = 0; i < 4; i++) {
            midway[i] += pair.xy * taps_midway[4 - i] + pair.zw * taps_midway[5 - i];
        }
    }
    let low = levels(u32(first), powers(vec4<f32>(at[0], midway[0]), vec4<f32>(at[1], midway[1])));
    let high = levels(u32(first) + 2u, powers(vec4<f32>(at[2], midway[2]), vec4<f32>(at[3], midway[3])));
    let next = levels(u32(first) + 4u, vec4<f32>(dot(at[4], at[4]))).x;
    let out = (row + u32(first)) >> 1u;
    polar[out] = pairs(low, high.x);
    polar[out + 1u] = pairs(high, next);
    if KEEP_LINES {
        lines[out] = vec4<f32>(at[0], at[1]);
        lines[out + 1u] = vec4<f32>(at[2], at[3]);
    }
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if MIDWAY {
        if id.x * 4u < params.row_samples {
            detect_with_midway(id.y * params.row_samples, i32(id.x * 4u));
        }
        return;
    }
    let first = i32(id.x * 8u);
    if first >= i32(params.row_samples) {
        return;
    }
    let row = id.y * params.row_samples;
    let half = i32(params.axial_half);
    // Reads the pairs of samples that the pulse spreads to any of the nine outputs.
    let even = (half + 1) & ~1;
    var a = vec4<f32>(0.0);
    var b = vec4<f32>(0.0);
    var c = vec4<f32>(0.0);
    var d = vec4<f32>(0.0);
    // Ninth output: the first sample of the next thread.
    var e = vec2<f32>(0.0);
    // Sliding window of taps; each pair of samples shifts it by two.
    var near = vec4<f32>(0.0);
    var far = vec4<f32>(0.0);
    var farthest = 0.0;
    var beyond = 0.0;
    for (var step = 0; step <= 2 * even + 8; step += 2) {
        let pair = pair_at(row, first - even + step);
        // tap(half + PULSE_PAD + d) weights a sample d after the output.
        let index = step - even + half + PULSE_PAD;
        beyond = far.w;
        farthest = far.z;
        far = vec4<f32>(near.zw, far.xy);
        near = vec4<f32>(tap(index + 1), tap(index), near.xy);
        a += vec4<f32>(pair.xy * near.y + pair.zw * near.x, pair.xy * near.z + pair.zw * near.y);
        b += vec4<f32>(pair.xy * near.w + pair.zw * near.z, pair.xy * far.x + pair.zw * near.w);
        c += vec4<f32>(pair.xy * far.y + pair.zw * far.x, pair.xy * far.z + pair.zw * far.y);
        d += vec4<f32>(pair.xy * far.w + pair.zw * far.z, pair.xy * farthest + pair.zw * far.w);
        e += pair.xy * beyond + pair.zw * farthest;
    }
    let low = levels(u32(first), powers(a, b));
    let high = levels(u32(first) + 4u, powers(c, d));
    let next = levels(u32(first) + 8u, vec4<f32>(dot(e, e))).x;
    let out = (row + u32(first)) >> 2u;
    polar[out] = pairs(low, high.x);
    polar[out + 1u] = pairs(high, next);
    if KEEP_LINES {
        lines[2u * out] = a;
        lines[2u * out + 1u] = b;
        lines[2u * out + 2u] = c;
        lines[2u * out + 3u] = d;
    }
}
