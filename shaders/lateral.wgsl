// Lateral point-spread function: each sample becomes the beam's weighted mean over neighbouring scanlines.
// Each block of DEPTH_BLOCK samples has a kernel; at the sector's edges the remaining weights are renormalised.
// Complex [scanlines × row_samples] in and out, two samples per vector. A thread makes four samples of four scanlines,
// so each scanline that it reads serves all four.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> kernels: array<f32>;
@group(0) @binding(2) var<storage, read> baseband: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> focused: array<vec4<f32>>;

fn store(line: u32, first: u32, a: vec4<f32>, b: vec4<f32>, total: f32) {
    if line < params.scanlines {
        let out = (line * params.row_samples + first) >> 1u;
        let scale = 1.0 / max(total, 1.0e-30);
        focused[out] = a * scale;
        focused[out + 1u] = b * scale;
    }
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let line = i32(id.y) * 4;
    let first = id.x * 4u;
    if first >= params.row_samples {
        return;
    }
    let half = i32(params.lateral_half);
    let kernel = i32((first >> BLOCK_SHIFT) * (2u * params.lateral_half + 1u)) + half;
    // Weights of the current scanline for the four outputs; each scanline shifts them by one.
    var weights = vec4<f32>(0.0);
    var total = vec4<f32>(0.0);
    var a0 = vec4<f32>(0.0);
    var b0 = vec4<f32>(0.0);
    var a1 = vec4<f32>(0.0);
    var b1 = vec4<f32>(0.0);
    var a2 = vec4<f32>(0.0);
    var b2 = vec4<f32>(0.0);
    var a3 = vec4<f32>(0.0);
    var b3 = vec4<f32>(0.0);
    for (var tap = -half; tap <= half + 3; tap++) {
        weights = vec4<f32>(select(0.0, kernels[kernel + min(tap, half)], tap <= half), weights.xyz);
        let source = line + tap;
        let there = source >= 0 && source < i32(params.scanlines);
        let w = select(vec4<f32>(0.0), weights, there);
        let at = (u32(clamp(source, 0, i32(params.scanlines) - 1)) * params.row_samples + first) >> 1u;
        let a = baseband[at];
        let b = baseband[at + 1u];
        total += w;
        a0 += w.x * a;
        b0 += w.x * b;
        a1 += w.y * a;
        b1 += w.y * b;
        a2 += w.z * a;
        b2 += w.z * b;
        a3 += w.w * a;
        b3 += w.w * b;
    }
    store(u32(line), first, a0, b0, total.x);
    store(u32(line) + 1u, first, a1, b1, total.y);
    store(u32(line) + 2u, first, a2, b2, total.z);
    store(u32(line) + 3u, first, a3, b3, total.w);
}
