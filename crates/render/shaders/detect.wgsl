// Axial pulse, envelope, TGC and log compression.
// In: focused baseband, two samples per vector. Out: one word per sample with the grey levels 0..=65535 of the sample
// and the next one, for scan conversion; with KEEP_LINES also the baseband after the pulse. Eight samples per thread.

@group(0) @binding(0) var<uniform> params: Params;
// Envelope of the pulse, with PULSE_PAD zeros before and after it.
@group(0) @binding(1) var<uniform> pulse: array<vec4<f32>, PULSE_QUADS>;
@group(0) @binding(2) var<storage, read> focused: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> polar: array<vec4<u32>>;
@group(0) @binding(4) var<storage, read_write> lines: array<vec4<f32>>;

override KEEP_LINES: bool = false;

fn tap(index: i32) -> f32 {
    return pulse[u32(index) >> 2u][u32(index) & 3u];
}

// Gain of the TGC sliders at a depth, dB, interpolated linearly.
fn slider_db(depth_mm: f32) -> f32 {
    let position = clamp(7.0 * depth_mm / params.depth_mm, 0.0, 7.0);
    let below = min(u32(position), 6u);
    let low = image_tgc_sliders_db(below);
    let high = image_tgc_sliders_db(below + 1u);
    return mix(low, high, position - f32(below));
}

// Grey levels 0..=1 of four samples from `first` on, from their powers.
fn levels(first: u32, power: vec4<f32>) -> vec4<f32> {
    let depth_mm = (vec4<f32>(0.5, 1.5, 2.5, 3.5) + f32(i32(first))) * params.sample_spacing_mm;
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

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let first = i32(id.x * 8u);
    if first >= i32(params.row_samples) {
        return;
    }
    let row = id.y * params.row_samples;
    let half = i32(params.axial_half);
    // Reads the pairs of samples that the pulse spreads to any of the nine outputs. Samples beyond the row's ends count
    // as 0.
    let even = (half + 1) & ~1;
    let last = i32(params.samples) - 1;
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
        let at = first - even + step;
        var pair = focused[(row + u32(clamp(at, 0, i32(params.row_samples) - 2))) >> 1u];
        let first_there = at >= 0 && at <= last;
        let second_there = at + 1 >= 0 && at + 1 <= last;
        pair = select(vec4<f32>(0.0), pair, vec4<bool>(first_there, first_there, second_there, second_there));
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
