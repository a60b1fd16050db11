// Axial pulse, envelope, TGC and log compression.
// In: focused baseband, two samples a vector. Out: grey level 0..=255 of each sample as f32, four a vector, and the
// pulse-shaped baseband where it is wanted. Four samples a thread.

@group(0) @binding(0) var<uniform> params: Params;
// Envelope of the pulse with PULSE_PAD zeros before and after it.
@group(0) @binding(1) var<storage, read> pulse: array<f32>;
@group(0) @binding(2) var<storage, read> focused: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> polar: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read_write> lines: array<vec4<f32>>;

override KEEP_LINES: bool = false;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let first = i32(id.x * 4u);
    if first >= i32(params.row_samples) {
        return;
    }
    let row = id.y * params.row_samples;
    let half = i32(params.axial_half);
    // Pairs of samples that reach any of the four: from the last even one before first − half on.
    let low = max((first - half) & ~1, 0);
    let high = min(first + 3 + half, i32(params.samples) - 1);
    var a = vec4<f32>(0.0);
    var b = vec4<f32>(0.0);
    for (var at = low; at <= high; at += 2) {
        // A row of odd length ends in the middle of a pair.
        let pair = focused[(row + u32(at)) / 2u]
            * select(vec4<f32>(1.0), vec4<f32>(1.0, 1.0, 0.0, 0.0), at + 1 == i32(params.samples));
        // pulse[centre + d] weights a sample d after the output.
        let d = at - first + half + PULSE_PAD;
        let w0 = pulse[d + 1];
        let w1 = pulse[d];
        let w2 = pulse[d - 1];
        let w3 = pulse[d - 2];
        let w4 = pulse[d - 3];
        a += vec4<f32>(pair.xy * w1 + pair.zw * w0, pair.xy * w2 + pair.zw * w1);
        b += vec4<f32>(pair.xy * w3 + pair.zw * w2, pair.xy * w4 + pair.zw * w3);
    }
    let power = vec4<f32>(dot(a.xy, a.xy), dot(a.zw, a.zw), dot(b.xy, b.xy), dot(b.zw, b.zw));
    let depth_mm = (vec4<f32>(0.5, 1.5, 2.5, 3.5) + f32(first)) * params.sample_spacing_mm;
    // 10·log10(x) = 3.0103·log2(x); the floor is far below any display.
    let level_db = 3.01029995664 * log2(max(power, vec4<f32>(1.0e-37)))
        + params.gain_db + params.tgc_db_per_mm * depth_mm;
    polar[(row + u32(first)) / 4u] = 255.0 * clamp(1.0 + level_db / params.dynamic_range_db, vec4<f32>(0.0), vec4<f32>(1.0));
    if KEEP_LINES {
        lines[(row + u32(first)) / 2u] = a;
        lines[(row + u32(first)) / 2u + 1u] = b;
    }
}
